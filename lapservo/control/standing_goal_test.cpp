#include "lapservo/control/standing_goal.h"

#include <functional>

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

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

TEST(ErrorGrowth, IsNoneWhereTheGoalMoves) {
  ErrorGrowth growth{Scales()};
  EXPECT_FALSE(grows(growth, goal(400, 5), 1, 300));
  EXPECT_FALSE(growth.add(goal(400), {0, 10, 0, 0}));
  EXPECT_FALSE(growth.add(goal(700), {0, 310, 0, 0})) << "another goal";
}

// Ticks until it is said, 0 for never. Limits take the part `taken` of what is wanted; the arm moves by `moved` of it.
int said_after(LimitedGoal& limited, const std::function<DesiredFeatures(int)>& desired, double error_px, double taken,
               double moved) {
  constexpr int ticks = 600;
  const Eigen::Vector4d wanted(0, 5 * error_px, 0, 0);
  for (int k = 1; k <= ticks; ++k)
    if (limited.add(desired(k), {0, -error_px, 0, 0}, wanted, taken * wanted, moved * wanted, 1.0 / 60)) return k;
  return 0;
}

TEST(LimitedGoal, IsOneForWhichTheArmStandsAtALimit) {
  const auto standing = [](int) { return goal(400); };
  LimitedGoal limited{Scales()};
  const auto after = [&](const auto& desired, double error_px, double taken, double moved) {
    limited.restart();
    return said_after(limited, desired, error_px, taken, moved);
  };
  EXPECT_NEAR(after(standing, 30, 1, 0), 122, 1);
  EXPECT_NEAR(after(standing, 3, 0.5, 0.05), 122, 1);
  EXPECT_NEAR(after([](int k) { return goal(400 + k % 3, 0.2 * (k % 3 - 1)); }, 30, 1, 0), 122, 1) << "by images";
  EXPECT_EQ(said_after(limited, standing, 30, 1, 0), 1) << "until something changes";
  const auto another = [](int) { return goal(500); };
  EXPECT_NEAR(said_after(limited, another, 30, 1, 0), 122, 1) << "another goal";
  int goes_on = 0;
  while (said_after(limited, another, 30, 0, 0) == 1 && goes_on < 100) ++goes_on;
  EXPECT_NEAR(goes_on, 70, 10) << "the joint is free";
  EXPECT_EQ(after(standing, 30, 0, 0), 0) << "something else than a limit holds it";
  EXPECT_EQ(after(standing, 30, 0.8, 0.2), 0) << "slides along the limit";
  EXPECT_EQ(after(standing, 1.5, 1, 0), 0) << "a goal on the limit";
  EXPECT_EQ(after([](int k) { return goal(400 + k, 60); }, 30, 1, 0), 0) << "a goal that moves";
}

}  // namespace
}  // namespace lapservo::internal
