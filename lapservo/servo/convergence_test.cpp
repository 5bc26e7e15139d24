#include "lapservo/servo/convergence.h"

#include <gtest/gtest.h>

namespace lapservo::internal::convergence_test {

constexpr double period_s = 0.1;

TEST(Convergence, TakesAWholeSecondWithin) {
  Convergence convergence;
  double time_s = 0;
  const auto add = [&](const Eigen::Vector4d& error, int count) {
    for (int i = 0; i < count; ++i, time_s += period_s) convergence.add(time_s, error);
  };
  const Eigen::Vector4d close(4e-3, 0.9, -0.9, 0.5);
  add({0, 0, 2, 0}, 5);
  add(close, 8);
  add({6e-3, 0, 0, 0}, 1);
  const double from_s = time_s;
  add(close, 9);
  EXPECT_FALSE(convergence.reached_s());
  add(close, 3);
  ASSERT_TRUE(convergence.reached_s());
  EXPECT_NEAR(*convergence.reached_s(), from_s, 1e-9);
  EXPECT_LT((convergence.rms_since() - close.cwiseAbs()).norm(), 1e-12);
}

// An error that swings is small for a second at its turning point. In a hold nothing is left.
TEST(Convergence, IsLeftAgain) {
  Convergence convergence;
  const auto add = [&](int from, int to, double r_px, bool held = false) {
    for (int i = from; i < to; ++i) convergence.add(i * period_s, {0, r_px, 0, 0}, held);
    return convergence.reached_s();
  };
  EXPECT_EQ(add(0, 20, 0.5), 0);
  EXPECT_EQ(add(20, 30, 3, true), 0);
  EXPECT_FALSE(add(30, 31, 3) || add(31, 40, 0.2));
  EXPECT_EQ(add(40, 50, 0.2), 31 * period_s);
  EXPECT_NEAR(convergence.rms_since()[1], 0.2, 1e-9);
  EXPECT_EQ(convergence.held_since(), 0);
  EXPECT_EQ(convergence.first_s(), 0);
}

}  // namespace lapservo::internal::convergence_test
