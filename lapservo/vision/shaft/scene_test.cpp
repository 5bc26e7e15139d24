#include "lapservo/vision/shaft/scene.h"

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

TEST(Scene, ShowsNoPointThatTheLensFoldsIntoTheImage) {
  Rig rig = scenes::usual_rig();
  rig.camera.distortion = {-0.3, 0, 0, 0, 0};
  const scenes::Sight sight(rig, cv::Mat(rig.camera.height_px, rig.camera.width_px, CV_8UC3, cv::Scalar(20, 200, 20)));
  const Scene scene = sight.scene();
  const Eigen::Vector3d ahead(0.005, 0, 0.1), aside(0.18, 0, 0.1);
  const std::uint8_t colour = scene.class_at({400, 300});
  for (const Eigen::Vector3d& point : {ahead, aside})
    EXPECT_EQ(scene.class_at(rig.camera.raw_from_point(point)), colour);
  EXPECT_EQ(scene.class_at_point(ahead), colour);
  EXPECT_EQ(scene.class_on_shaft(ahead), colour);
  EXPECT_EQ(scene.class_at_point(aside), Scene::outside);
  EXPECT_EQ(scene.class_on_shaft(aside), Scene::outside);
}

}  // namespace
}  // namespace lapservo::internal
