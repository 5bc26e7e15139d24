#include "lapservo/servo/convergence.h"

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

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

TEST(Convergence, CountsWhatComesAfter) {
  Convergence convergence;
  for (int i = 0; i < 20; ++i) convergence.add(i * period_s, Eigen::Vector4d::Zero());
  for (int i = 20; i < 40; ++i) convergence.add(i * period_s, {0, 3, 0, 0});
  EXPECT_EQ(convergence.reached_s(), 0);
  EXPECT_NEAR(convergence.rms_since()[1], 3 / std::sqrt(2), 1e-9);
}

}  // namespace
}  // namespace lapservo::internal
