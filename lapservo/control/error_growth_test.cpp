#include "lapservo/control/error_growth.h"

#include <gtest/gtest.h>

namespace lapservo::internal::error_growth_test {

DesiredFeatures goal(double r_px, double rate = 0) {
  DesiredFeatures desired;
  desired.features = {0.9, r_px, 180, 100};
  desired.rate[1] = rate;
  return desired;
}

bool grows(ErrorGrowth& growth, const DesiredFeatures& desired, double from_px, double to_px) {
  bool said = false;
  for (int k = 0; k <= 100; ++k) said |= growth.add(desired, {0, from_px + (to_px - from_px) * k / 100, 0, 0});
  return said;
}

TEST(ErrorGrowth, IsAnErrorThatGrowsForAGoalThatStands) {
  for (const double begin_px : {1.0, 30.0, 200.0}) {
    ErrorGrowth growth{Scales()};
    EXPECT_FALSE(grows(growth, goal(400), 2 * begin_px, begin_px));
    EXPECT_FALSE(grows(growth, goal(400), begin_px, begin_px + 15)) << "small";
    EXPECT_FALSE(grows(growth, goal(400), begin_px + 15, begin_px));
    EXPECT_TRUE(grows(growth, goal(400), begin_px, 1.6 * begin_px + 25));
    growth.restart();
    EXPECT_FALSE(grows(growth, goal(400), 1.6 * begin_px + 25, begin_px));
  }
}

// Each image corrects the goal of a tip a little.
TEST(ErrorGrowth, IsOneWhereImagesCorrectTheGoal) {
  ErrorGrowth growth{Scales()};
  bool said = false;
  for (int k = 0; k <= 100; ++k) said |= growth.add(goal(400 + k % 3, 0.2 * (k % 3 - 1)), {0, 30 + 0.5 * k, 0, 0});
  EXPECT_TRUE(said);
}

TEST(ErrorGrowth, IsNoneWhereTheGoalMoves) {
  ErrorGrowth growth{Scales()};
  EXPECT_FALSE(grows(growth, goal(400, 5), 1, 300));
  EXPECT_FALSE(growth.add(goal(400), {0, 10, 0, 0}));
  EXPECT_FALSE(growth.add(goal(700), {0, 310, 0, 0})) << "another goal";
}

}  // namespace lapservo::internal::error_growth_test
