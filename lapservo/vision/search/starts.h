#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Blood along a side makes a shaft look thin, so far away: it may be nearer by this factor.
inline constexpr double nearer_scale = 0.8;

struct Starts {
  std::vector<PoseUnknowns> poses;  ///< the likeliest first
  std::size_t rivals = 0;           ///< of the first so many, each may fit
  /// Most lines along the shaft show all four boundaries, at lengths that the marker has at no azimuth.
  bool other_bands = false;
};

/// Rough poses (rotation unknown, psi = 0) of a marker somewhere in a blob that may show other markers as well. Lines
/// along the shaft are split into the marker's bands; those that agree side by side are the marker. The lines pass
/// through the image of the RCM; without one (nullopt) they are parallel to the blob and then square to the marker's
/// ends, and the poses are free. The ends give the depth with the RCM, else the tilt (two poses: tip towards or away
/// from the camera); the width gives the depth where they do not. Where the image or another instrument hides one
/// side, the axis lies a radius beside the other. In a scene with others, what they hide may be any part of the marker,
/// so lines are split twice: with what is theirs left out and as they are. None of a blob that shows the bands in
/// another order.
Starts starts_in(const Scene& scene, const Blob& blob, const std::optional<Rigid3>& camera_from_rcm);

}  // namespace lapservo::internal
