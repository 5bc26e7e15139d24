#include "lapservo/tool/tool.h"

#include <array>
#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/tool/test_tools.h"

namespace lapservo::internal::tool_test {
using testing::input_error;

using Covariance = TipInMarker::Covariance;
using Motion = Eigen::Matrix<double, 6, 1>;
using Wrist = std::array<double, 2>;

// Position, then rotation vector about the axes of the frame that both stand in.
Motion motion_between(const Rigid3& from, const Rigid3& to) {
  Motion motion;
  motion << to.translation - from.translation, rotation_vector_of(to.rotation * from.rotation.conjugate());
  return motion;
}

Tool with_changed_place(Tool tool, Eigen::Index number, double change) {
  if (number < 3) tool.place->base_in_marker_m[number] += change;
  if (number == 3) tool.place->azimuth_rad += change;
  if (number > 3) tool.wrist[static_cast<std::size_t>(number - 4)].offset_rad += change;
  return tool;
}

template <typename Pose>  // of a change of one number
Motion slope(const Pose& pose) {
  constexpr double step = 1e-6;
  return motion_between(pose(-step), pose(step)) / (2 * step);
}

// The covariance by the sigmas of both readings: of the joint of each, and of its mirror image in a snake.
template <typename Readings>
Covariance of_readings(const Tool& tool, const Readings& wrist) {
  Covariance covariance = Covariance::Zero();
  for (std::size_t k = 0; k < 2; ++k) {
    const Motion motion = slope([&](double change) {
      Readings moved = wrist;
      moved[k] += change;
      if (tool.snake_like) moved[moved.size() - 1 - k] += change;
      return tip_in_marker(tool, moved).marker_from_tip;
    });
    covariance += std::pow(tool.wrist[k].sigma_reading_rad, 2) * motion * motion.transpose();
  }
  return covariance;
}

TEST(TipInMarker, CovarianceIsThatOfFiniteDifferences) {
  const Tool tool = placed_tool();
  Random random(1);
  for (int i = 0; i < 20; ++i) {
    const Wrist wrist{random.uniform(-1.3, 1.3), random.uniform(-1.3, 1.3)};
    Eigen::Matrix<double, 6, 8> by_place = Eigen::Matrix<double, 6, 8>::Zero();
    for (Eigen::Index k = 0; k < 6; ++k)
      by_place.col(k) = slope(
          [&](double change) { return tip_in_marker(with_changed_place(tool, k, change), wrist).marker_from_tip; });
    const TipInMarker tip = tip_in_marker(tool, wrist);
    EXPECT_TRUE(tip.of_place.isApprox(by_place * tool.place->covariance * by_place.transpose(), 1e-6)) << i;
    EXPECT_TRUE(tip.of_readings.isApprox(of_readings(tool, wrist), 1e-6)) << i;
    EXPECT_TRUE(tip.covariance_m2.isApprox((tip.of_place + tip.of_readings).topLeftCorner<3, 3>(), 1e-12)) << i;
  }
}

TEST(TipInMarker, OfASnakeHasTwoReadingsWhoseErrorsAreThoseOfTwoJointsEach) {
  Tool tool = placed_tool();
  tool.wrist = {tool.wrist[0], tool.wrist[1], tool.wrist[1], tool.wrist[0]};
  tool.snake_like = true;
  const std::array<double, 4> wrist{0.1, 0.2, 0.2, 0.1};
  EXPECT_TRUE(tip_in_marker(tool, wrist).of_readings.isApprox(of_readings(tool, wrist), 1e-6));
}

TEST(TipInMarker, RefusesReadingsThatAreNone) {
  Tool tool = placed_tool();
  EXPECT_NE(input_error([&] { tip_in_marker(tool, Wrist{0, NAN}); }).find("wrist_yaw: is nan"), std::string::npos);
  EXPECT_NE(input_error([&] { tip_in_marker(tool, Wrist{HUGE_VAL, 0}); }).find("pitch: is inf"), std::string::npos);
  EXPECT_NE(input_error([&] { tip_in_marker(tool, std::array{0.1}); }), "");
  EXPECT_NE(input_error([&] { tip_in_marker(tool, std::array{0.1, 0.1, 0.1}); }), "");
  tool.place.reset();
  EXPECT_NE(input_error([&] { tip_in_marker(tool, Wrist{0, 0}); }).find("place: is missing"), std::string::npos);
}

TEST(TipInCamera, CovarianceIsThatOfFiniteDifferences) {
  const TipInMarker tip = tip_in_marker(placed_tool(), Wrist{0.5, -0.3});
  const Rigid3 pose{Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {0.01, -0.02, 0.1}};
  Covariance by_pose, by_tip;
  for (Eigen::Index k = 0; k < 6; ++k) {
    const auto changed = [k](Rigid3 from, double change) {
      const Motion motion = change * Motion::Unit(k);
      return Rigid3{rotation_by(motion.tail<3>()) * from.rotation, from.translation + motion.head<3>()};
    };
    by_pose.col(k) = slope([&](double change) { return changed(pose, change) * tip.marker_from_tip; });
    by_tip.col(k) = slope([&](double change) { return pose * changed(tip.marker_from_tip, change); });
  }
  Covariance root;
  Random random(3);
  for (double& number : root.reshaped()) number = 1e-3 * random.normal();
  const Covariance of_pose = root * root.transpose();
  const Covariance expected =
      by_pose * of_pose * by_pose.transpose() + by_tip * (tip.of_place + tip.of_readings) * by_tip.transpose();
  EXPECT_TRUE(tip_covariance_in_camera(pose, of_pose, tip).isApprox(expected, 1e-6));
}

}  // namespace lapservo::internal::tool_test
