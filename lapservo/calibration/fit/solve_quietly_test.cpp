#include "lapservo/calibration/fit/solve_quietly.h"

#include <array>
#include <stdexcept>

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

// Rosenbrock's valley, which takes some iterations.
struct Valley {
  template <typename T>
  bool operator()(const T* x, T* residuals) const {
    residuals[0] = T(1) - x[0], residuals[1] = T(10) * (x[1] - x[0] * x[0]);
    return true;
  }
};

bool solved(double& x, ceres::Solver::Summary& summary, const AtIteration& at_iteration) {
  std::array<double, 2> at{-1.2, 1};
  ceres::Problem problem;
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Valley, 2, 2>(new Valley), nullptr, at.data());
  const bool usable = solve_quietly({}, problem, summary, at_iteration);
  x = at[0];
  return usable;
}

TEST(SolveQuietly, CallsAtEachIteration) {
  ceres::Solver::Summary summary;
  double x = 0;
  int calls = 0;
  ASSERT_TRUE(solved(x, summary, [&] { ++calls; }));
  EXPECT_NEAR(x, 1, 1e-5);
  EXPECT_EQ(calls, static_cast<int>(summary.iterations.size()));
  EXPECT_GT(calls, 5);
}

TEST(SolveQuietly, IsLeftByWhatIsThrown) {
  ceres::Solver::Summary summary;
  double x = 0;
  int calls = 0;
  EXPECT_THROW(solved(x, summary,
                      [&] {
                        if (++calls == 3) throw std::runtime_error("Ctrl-C");
                      }),
               std::runtime_error);
  EXPECT_EQ(calls, 3);
  EXPECT_TRUE(solved(x, summary, {})) << "the next one";
}

}  // namespace
}  // namespace lapservo::internal
