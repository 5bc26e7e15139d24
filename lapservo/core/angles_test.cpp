#include "lapservo/core/angles.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::angles_test {

double angular_distance(double a_rad, double b_rad) {
  return std::abs(std::remainder(a_rad - b_rad, two_pi));
}

TEST(Angles, WrappingKeepsTheAngleAndLandsInTheInterval) {
  testing::SeededRandom random(11);
  for (int i = 0; i < 10000; ++i) {
    const double angle_rad = random.uniform(-100, 100);
    const double centred = wrap_pi(angle_rad), positive = wrap_two_pi(angle_rad);
    ASSERT_GE(centred, -pi) << angle_rad;
    ASSERT_LT(centred, pi) << angle_rad;
    ASSERT_GE(positive, 0) << angle_rad;
    ASSERT_LT(positive, two_pi) << angle_rad;
    ASSERT_LT(angular_distance(centred, angle_rad), 1e-12) << angle_rad;
    ASSERT_LT(angular_distance(positive, angle_rad), 1e-12) << angle_rad;
    ASSERT_EQ(wrap_pi(centred), centred);
    ASSERT_EQ(wrap_two_pi(positive), positive);
  }
}

TEST(Angles, TheEndsOfTheIntervalsBelongToTheirBeginnings) {
  EXPECT_EQ(wrap_pi(pi), -pi);
  EXPECT_EQ(wrap_pi(-pi), -pi);
  EXPECT_EQ(wrap_pi(3 * pi), -pi);
  EXPECT_EQ(wrap_two_pi(two_pi), 0);
  EXPECT_EQ(wrap_two_pi(-two_pi), 0);
  EXPECT_LT(wrap_two_pi(-std::numeric_limits<double>::min()), two_pi);
}

}  // namespace lapservo::internal::angles_test
