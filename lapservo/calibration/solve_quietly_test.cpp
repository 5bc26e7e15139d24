#include "lapservo/calibration/solve_quietly.h"

#include <array>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lapservo/calibration/asked_while_fitting.h"

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

bool solved(double& x, ceres::Solver::Summary& summary) {
  std::array<double, 2> at{-1.2, 1};
  ceres::Problem problem;
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Valley, 2, 2>(new Valley), nullptr, at.data());
  const bool usable = solve_quietly({}, problem, summary);
  x = at[0];
  return usable;
}

TEST(SolveQuietly, AsksAtEachIteration) {
  ceres::Solver::Summary summary;
  double x = 0;
  int asked = 0, asked_outside = 0;
  const AskedWhileFitting outside([&] { return ++asked_outside > 0; });
  {
    const AskedWhileFitting inside([&] { return ++asked > 0; });
    ASSERT_TRUE(solved(x, summary));
  }
  EXPECT_NEAR(x, 1, 1e-5);
  EXPECT_EQ(asked, static_cast<int>(summary.iterations.size()));
  EXPECT_GT(asked, 5);
  EXPECT_EQ(asked_outside, 0);
  ASSERT_TRUE(solved(x, summary));
  EXPECT_EQ(asked_outside, asked);
}

TEST(SolveQuietly, IsLeftByWhatIsThrown) {
  ceres::Solver::Summary summary;
  double x = 0;
  int asked = 0;
  {
    const AskedWhileFitting asking([&] {
      if (++asked == 3) throw std::runtime_error("Ctrl-C");
      return false;
    });
    EXPECT_THROW(solved(x, summary), std::runtime_error);
  }
  EXPECT_EQ(asked, 3);
  EXPECT_TRUE(solved(x, summary)) << "the next one";
  EXPECT_EQ(asked, 3);
}

}  // namespace
}  // namespace lapservo::internal
