#pragma once

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

struct ViewLimits {
  double steepest_rad;  ///< how far the shaft may lean towards or away from the camera
  double border_px;     ///< how far from the image's border the marker must stay
};

/// Whether the whole visible side of the marker lies in the (raw) image, seen from not too steep an angle.
bool marker_in_view(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled,
                    const ViewLimits& limits);

}  // namespace lapservo::internal
