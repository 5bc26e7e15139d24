#include "lapservo/vision/model/normal_equations.h"

#include <Eigen/QR>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

struct Problem {
  Eigen::MatrixXd rows;
  Eigen::VectorXd residuals, weights;

  NormalEquations equations() const {
    NormalEquations equations(static_cast<int>(rows.cols()));
    for (Eigen::Index i = 0; i < rows.rows(); ++i) equations.add(rows.row(i).transpose(), residuals[i], weights[i]);
    return equations;
  }
};

Problem random_problem(std::uint64_t seed, int unknowns, int measurements = 30) {
  Random random(seed);
  Problem problem{Eigen::MatrixXd(measurements, unknowns), Eigen::VectorXd(measurements),
                  Eigen::VectorXd(measurements)};
  for (double& x : problem.rows.reshaped()) x = random.normal();
  for (double& x : problem.residuals) x = random.normal();
  for (double& x : problem.weights) x = random.uniform(0.1, 10);
  return problem;
}

TEST(NormalEquations, SolveLikeADenseLeastSquaresSolver) {
  for (int unknowns = 1; unknowns <= max_unknowns; ++unknowns) {
    const auto seed = static_cast<std::uint64_t>(unknowns);
    const Problem p = random_problem(seed, unknowns);
    const Eigen::MatrixXd scaled = p.weights.cwiseSqrt().asDiagonal() * p.rows;
    const Eigen::VectorXd expected =
        scaled.colPivHouseholderQr().solve(p.weights.cwiseSqrt().cwiseProduct(p.residuals));
    EXPECT_TRUE(p.equations().solve(0).isApprox(expected, 1e-9)) << "seed " << seed;
    EXPECT_TRUE(p.equations().information().isApprox(scaled.transpose() * scaled, 1e-12)) << "seed " << seed;
  }
}

TEST(NormalEquations, DampingScalesTheDiagonal) {
  const Problem p = random_problem(11, 6);
  const UnknownMatrix information = p.equations().information();
  const Eigen::VectorXd gradient = p.rows.transpose() * p.weights.asDiagonal() * p.residuals;
  for (const double damping : {1e-3, 0.1, 10.0}) {
    Eigen::MatrixXd damped = information;
    damped.diagonal() *= 1 + damping;
    EXPECT_TRUE(p.equations().solve(damping).isApprox(damped.ldlt().solve(gradient), 1e-9)) << damping;
  }
}

TEST(NormalEquations, DirectionsWithoutInformationGetNoStep) {
  Problem p = random_problem(12, 5);
  p.rows.col(2).setZero();
  const UnknownVector step = p.equations().solve(1e-4);
  EXPECT_EQ(step[2], 0);
  Problem without = p;
  without.rows.col(2) = p.rows.col(4);
  without.rows.conservativeResize(Eigen::NoChange, 4);
  const UnknownVector expected = without.equations().solve(1e-4);
  EXPECT_NEAR(step[0], expected[0], 1e-12);
  EXPECT_NEAR(step[1], expected[1], 1e-12);
  EXPECT_NEAR(step[4], expected[2], 1e-12);
  EXPECT_NEAR(step[3], expected[3], 1e-12);
  EXPECT_TRUE(NormalEquations(4).solve(0).isZero());
}

// Iterative reweighting minimises a loss when the weight is its derivative over the residual: here Cauchy's
// c^2 / 2 log(1 + (x / c)^2).
TEST(NormalEquations, TheCauchyWeightIsThatOfItsLoss) {
  for (const double scale : {0.5, 2.5, 10.0})
    for (double x = 0.05; x < 30; x *= 1.4) {
      const auto loss = [&](double r) { return 0.5 * scale * scale * std::log1p(r * r / (scale * scale)); };
      const double h = 1e-5 * x;
      EXPECT_NEAR(cauchy_weight(x, scale), (loss(x + h) - loss(x - h)) / (2 * h) / x, 1e-6);
      EXPECT_EQ(cauchy_weight(x, scale), cauchy_weight(-x, scale));
    }
}

}  // namespace
}  // namespace lapservo::internal
