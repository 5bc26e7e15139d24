#include "lapservo/rcm/line_observation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/rcm/test_lines.h"

namespace lapservo::internal {
namespace {

TEST(LineObservation, LinesThroughAPointMeetThere) {
  testing::SeededRandom random(61);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector2d point(random.uniform(-2000, 2000), random.uniform(-2000, 2000));
    const auto lines = testing::fan_of_lines(point, 2, 1, random);
    const auto met = intersection_px(lines[0], lines[1]);
    ASSERT_TRUE(met);
    EXPECT_LT((*met - point).norm(), 1e-4);
  }
}

TEST(LineObservation, ToldApartFromWhatIsNone) {
  EXPECT_TRUE(is_usable(line_between({0, 0}, {100, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({7, 7}, {7, 7}, 1)));
  EXPECT_FALSE(is_usable(line_between({NAN, 0}, {100, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({0, 0}, {1e200, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({0, 0}, {100, 50}, NAN)));
}

}  // namespace
}  // namespace lapservo::internal
