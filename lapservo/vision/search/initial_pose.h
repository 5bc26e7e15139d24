#pragma once

#include <vector>

#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

struct InitialPoses {
  std::vector<PoseUnknowns> poses;
  /// Lines along the blob show all four boundaries, at lengths that the marker has at no azimuth.
  bool other_bands = false;
};

/// Rough free poses (rotation unknown, psi = 0) of a marker that a blob may be: the shaft's sides are two lines fitted
/// to the blob's outline; their distance gives the depth, the ends of the colours the place along the axis. The
/// foreshortening leaves two poses (tip towards or away from the camera), or one where there is none. None when the
/// blob lacks the marker's colours in their order, or the image's border hides a side.
InitialPoses initial_poses(const Scene& scene, const Blob& blob);

}  // namespace lapservo::internal
