#pragma once

#include <vector>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/vision/colour/blob_search.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Rough poses (rotation unknown, psi = 0) of a marker somewhere in a blob that may show other markers as well: shafts
/// through the RCM show as lines through its image, so all lines that meet the blob are split into the marker's bands,
/// and those that agree side by side are the marker. Its ends give the depth, or where one is hidden its width. Where
/// the image or another instrument hides one side, the axis lies a radius beside the other. At most three; of a scene
/// with others six: what they hide may be any part of the marker, so lines are split twice, with what is theirs left
/// out and as they are. None of a blob that shows the bands in another order.
std::vector<PoseUnknowns> starts_through_rcm(const Scene& scene, const Blob& blob, const Rigid3& camera_from_rcm);

}  // namespace lapservo::internal
