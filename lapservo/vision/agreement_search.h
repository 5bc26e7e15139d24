#pragma once

#include <vector>

#include "lapservo/vision/scene.h"
#include "lapservo/vision/shaft_pose.h"

namespace lapservo::internal {

/// For markers that blood hides in large parts, where fitted sides and ends mislead: climbs to the configurations whose
/// predicted colours agree best with the frame, blood counting little against and colour beside the marker much. Only
/// for unknowns with an RCM. Up to two results (of different rotations), best first, good to a few pixels.
std::vector<PoseUnknowns> search_agreement(const Scene& scene, const PoseUnknowns& start,
                                           const Rigid3& camera_from_rcm);

}  // namespace lapservo::internal
