#include "lapservo/vision/image/lens_field.h"

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

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

}  // namespace
}  // namespace lapservo::internal
