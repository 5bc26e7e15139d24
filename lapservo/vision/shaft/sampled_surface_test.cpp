#include "lapservo/vision/shaft/sampled_surface.h"

#include <gtest/gtest.h>

#include "lapservo/testing/scenes.h"

namespace lapservo::internal::sampled_surface_test {

TEST(LineInImage, ShowsNoPointThatTheLensFoldsIntoTheImage) {
  Rig rig = scenes::usual_rig();
  rig.camera.distortion = {-0.3, 0, 0, 0, 0};
  const scenes::Sight sight(rig, cv::Mat(rig.camera.height_px, rig.camera.width_px, CV_8UC3, cv::Scalar(20, 200, 20)));
  const Scene scene = sight.scene();
  const Eigen::Vector3d ahead(0.005, 0, 0.1), aside(0.18, 0, 0.1);
  const std::uint8_t colour = scene.class_at({400, 300});
  for (const Eigen::Vector3d& point : {ahead, aside})
    EXPECT_EQ(scene.class_at(rig.camera.raw_from_point(point)), colour);
  const auto shows = [&](const Eigen::Vector3d& point, bool on_shaft) {
    return LineInImage<1>(scene, point, Eigen::Vector3d::Zero()).pixel(0, on_shaft) != nullptr;
  };
  for (const bool on_shaft : {false, true}) EXPECT_TRUE(shows(ahead, on_shaft) && !shows(aside, on_shaft));
}

}  // namespace lapservo::internal::sampled_surface_test
