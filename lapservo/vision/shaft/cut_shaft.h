#pragma once

#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Whether the image's border hides one of the shaft's sides: at least three quarters of what shows of the other.
bool cut_along(const Scene& scene, const ShaftPose& pose);

}  // namespace lapservo::internal
