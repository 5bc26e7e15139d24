#pragma once

#include "lapservo/vision/edges/edge_blur.h"

namespace lapservo::internal {

/// A boundary's course in the image about a point of it, in coordinates along the shaft and across it, and how the
/// light changes across the shaft there.
struct BoundaryCourse {
  double slope = 0;                ///< d(along)/d(across)
  double curvature_per_px = 0;     ///< d2(along)/d(across)2
  double light_change_per_px = 0;  ///< d(log light)/d(across)
};

/// How far along the shaft a wide blur moves a boundary: it mixes what lies beside on either side, and more of where
/// there is more light. To second order of the blur.
inline double moved_by_blur_px(const BoundaryCourse& course, const BlurEllipse& blur) {
  return (course.slope * blur.across_px2 - blur.oblique_px2) * course.light_change_per_px +
         0.5 * course.curvature_per_px * blur.across_px2;
}

}  // namespace lapservo::internal
