#include "lapservo/vision/image/lens_field.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::internal::lens_field_test {

Camera barrel() {
  Camera camera = scenes::usual_rig().camera;
  camera.distortion = {-0.3, 0, 0, 0, 0};
  return camera;
}

TEST(LensField, HoldsWhatEachPixelShows) {
  const Camera camera = barrel();
  const LensField field(camera);
  for (int u = 0; u < camera.width_px; u += 40)
    for (int v = 0; v < camera.height_px; v += 40) {
      const auto ideal_px = camera.ideal_from_raw({u, v});
      ASSERT_TRUE(ideal_px) << u << ", " << v;
      EXPECT_TRUE(field.contains(0.1 * camera.ray_from_ideal(*ideal_px))) << u << ", " << v;
    }
  EXPECT_FALSE(field.contains({0, 0, -0.1}));
}

TEST(LensField, LeavesOutWhatTheDistortionFoldsIntoTheImage) {
  const Camera camera = barrel();
  const Eigen::Vector3d aside(0.18, 0, 0.1);
  EXPECT_TRUE(camera.contains(camera.raw_from_point(aside)));
  EXPECT_FALSE(LensField(camera).contains(aside));
}

// Endoscopes show a circle: the corners were never measured.
TEST(LensField, EndsWhereTheImageItselfFolds) {
  Camera camera = barrel();
  camera.distortion[0] = -0.45;
  ASSERT_TRUE(is_invertible(camera));
  ASSERT_FALSE(is_invertible_everywhere(camera));
  const LensField field(camera);
  int folded = 0;
  for (double angle_rad = 0; angle_rad < 6.28; angle_rad += 0.1)
    for (double away = 0; away < 3; away += 0.01) {
      const Eigen::Vector3d point(away * std::cos(angle_rad), away * std::sin(angle_rad), 1);
      const Eigen::Vector2d raw_px = camera.raw_from_point(point);
      if (!camera.contains(raw_px)) continue;
      const auto ideal_px = camera.ideal_from_raw(raw_px);
      const bool is_shown = ideal_px && (camera.ray_from_ideal(*ideal_px) - point).norm() < 1e-6;
      folded += !is_shown;
      EXPECT_TRUE(is_shown || !field.contains(point)) << away << " at " << angle_rad;
    }
  EXPECT_GT(folded, 100);
  const double radius_px = 0.5 * camera.height_px - 1;
  for (double angle_rad = 0; angle_rad < 6.28; angle_rad += 0.1) {
    const Eigen::Vector2d raw_px(0.5 * camera.width_px + radius_px * std::cos(angle_rad),
                                 0.5 * camera.height_px + radius_px * std::sin(angle_rad));
    EXPECT_TRUE(field.contains(camera.ray_from_ideal(camera.ideal_from_raw(raw_px).value()))) << angle_rad;
  }
}

}  // namespace lapservo::internal::lens_field_test
