#include "lapservo/calibration/fit/ceres_fit.h"

#include <array>
#include <stdexcept>

#include <gtest/gtest.h>

namespace lapservo::internal::ceres_fit_test {

// Rosenbrock's valley, which takes some iterations.
struct Valley {
  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    residuals[0] = T(1) - x[0], residuals[1] = T(10) * (x[1] - x[0] * x[0]);
    return true;
  }
};

// How many iterations it took.
std::size_t solved(const AtIteration& at_iteration) {
  std::array<double, 2> at{-1.2, 1};
  ceres::Problem problem;
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Valley, 2, 2>(new Valley), nullptr, at.data());
  const auto summary = solve_quietly({}, problem, at_iteration);
  EXPECT_TRUE(summary.IsSolutionUsable());
  EXPECT_NEAR(at[0], 1, 1e-5);
  return summary.iterations.size();
}

TEST(SolveQuietly, CallsAtEachIteration) {
  std::size_t calls = 0;
  const std::size_t iterations = solved([&] { ++calls; });
  EXPECT_EQ(calls, iterations);
  EXPECT_GT(calls, 5U);
}

TEST(SolveQuietly, IsLeftByWhatIsThrown) {
  int calls = 0;
  const auto interrupt = [&] {
    if (++calls == 3) throw std::runtime_error("Ctrl-C");
  };
  EXPECT_THROW(solved(interrupt), std::runtime_error);
  EXPECT_EQ(calls, 3);
  EXPECT_GT(solved({}), 0U) << "the next one";
}

}  // namespace lapservo::internal::ceres_fit_test
