#include "lapservo/vision/shaft/cut_shaft.h"

#include <gtest/gtest.h>

#include "lapservo/geometry/rotation.h"
#include "lapservo/testing/scenes.h"

namespace lapservo::internal {
namespace {

// A shaft that lies along the rows through the middle of the camera's picture, of which so many columns and rows show.
bool cut(double columns, double rows, double shift_m = 0) {
  const Rig rig = scenes::usual_rig();
  const Camera& camera = rig.camera;
  const double half_m = rig.instruments[0].marker.length_m() / 2;
  const ShaftPose pose{{rotation_between(Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX()), {-half_m, shift_m, 0.1}},
                       0};
  const cv::Mat picture(cvRound(rows * 2 * camera.cy_px), cvRound(columns * 2 * camera.cx_px), CV_8UC3, cv::Scalar());
  return cut_along(scenes::Sight(rig, picture).scene(), pose);
}

TEST(CutShaft, HasOneSideBeyondTheBorder) {
  EXPECT_TRUE(cut(1, 0.5));
  const double radius_m = scenes::usual_rig().instruments[0].marker.radius_m();
  EXPECT_TRUE(cut(1, 0.5, 0.9 * radius_m));
  EXPECT_TRUE(cut(1, 0.5, -0.9 * radius_m));
  EXPECT_TRUE(cut(0.5, 0.5)) << "and an end beyond another";
}

TEST(CutShaft, HasBothSidesWhereAnEndAloneIsHidden) {
  EXPECT_FALSE(cut(1, 1));
  EXPECT_FALSE(cut(0.5, 1));
}

TEST(CutShaft, ShowsOne) {
  const double radius_m = scenes::usual_rig().instruments[0].marker.radius_m();
  EXPECT_FALSE(cut(1, 0.5, 1.2 * radius_m)) << "wholly outside";
  EXPECT_FALSE(cut(1, 0.5, -1.2 * radius_m)) << "wholly inside";
}

}  // namespace
}  // namespace lapservo::internal
