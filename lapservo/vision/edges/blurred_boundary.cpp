#include "lapservo/vision/edges/blurred_boundary.h"

namespace lapservo::internal {

double moved_by_blur_px(const BoundaryCourse& course, const BlurEllipse& blur) {
  return (course.slope * blur.across_px2 - blur.oblique_px2) * course.light_change_per_px +
         0.5 * course.curvature_per_px * blur.across_px2;
}

}  // namespace lapservo::internal
