#pragma once

#include <cstddef>

#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// On how many of so many lines along the marker nothing hides a boundary: colours of the marker, whichever, show on
/// both sides, of an end inside.
int lines_in_clear_view(const Scene& scene, const ShaftPose& pose, std::size_t boundary, int lines);

}  // namespace lapservo::internal
