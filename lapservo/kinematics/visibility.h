#pragma once

#include <optional>

#include "lapservo/core/random.h"
#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

struct ViewLimits {
  double steepest_rad;  ///< how far the shaft may lean towards or away from the camera
  double border_px;     ///< how far from the image's border the marker must stay
};

/// Whether the whole visible side of the marker lies in the (raw) image, seen from not too steep an angle.
bool marker_in_view(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled,
                    const ViewLimits& limits);

/// Region of the configurations to draw: the depth of the marker's proximal end, and the conditions of marker_in_view.
struct ViewRange {
  double nearest_m, farthest_m;
  ViewLimits limits;
};

/// A configuration of a marker wholly in view: its proximal end at any pixel and depth alike, psi at any angle. Nullopt
/// when thousands of draws had none.
std::optional<JointVector> random_configuration_in_view(const Camera& camera, const Marker& marker,
                                                        const Rigid3& camera_from_rcm, const ViewRange& range,
                                                        Random& random);

}  // namespace lapservo::internal
