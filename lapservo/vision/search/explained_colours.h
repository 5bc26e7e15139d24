#pragma once

#include <cmath>

#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// How much of the frame's colours a marker in this pose explains, of which blood may hide much [px^2, about]: the area
/// that shows the colour that belongs there, less a little for what blood hides, less what contradicts: other colours,
/// and bare shaft, which has none at all, on the marker; the marker's colours beside it, and blood where bare shaft
/// should be. By area, since of shafts that lie within the colours the largest explains most. `turned`: at the pose's
/// rotation; else as at any. Only areas above `above_px2` are wanted: no_area_px2 as soon as it can't be one.
inline constexpr double no_area_px2 = -HUGE_VAL;
double explained_area_px2(const Scene& scene, const ShaftPose& pose, bool turned, double above_px2 = no_area_px2);

}  // namespace lapservo::internal
