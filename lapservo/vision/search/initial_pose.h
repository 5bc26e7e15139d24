#pragma once

#include <optional>
#include <vector>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

struct InitialPoses {
  std::vector<PoseUnknowns> poses;
  /// Lines along the blob show all four boundaries, at lengths that the marker has at no azimuth.
  bool other_bands = false;
};

/// Rough poses (rotation unknown, psi = 0) of a marker that a blob may be: the shaft's sides are two lines fitted to
/// the blob's outline; their distance gives the depth, the ends of the colours the place along the axis. With
/// camera_from_rcm they are ways to one pose: first, where both ends show, at the depth at which the marker is as long
/// as it looks, then at that of the width. Without it the foreshortening leaves two poses (tip towards or away from the
/// camera), or one where there is none. Where the image's border hides one side all along, the other one, both ends and
/// the RCM give a pose. None when the blob lacks the marker's colours in their order.
InitialPoses initial_poses(const Scene& scene, const Blob& blob, const std::optional<Rigid3>& camera_from_rcm);

}  // namespace lapservo::internal
