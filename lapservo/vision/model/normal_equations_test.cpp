#include "lapservo/vision/model/normal_equations.h"

#include <Eigen/QR>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::normal_equations_test {

struct Problem {
  Eigen::MatrixXd rows;
  Eigen::VectorXd residuals, weights;

  NormalEquations equations() const {
    NormalEquations equations;
    for (Eigen::Index i = 0; i < rows.rows(); ++i) equations.add(rows.row(i).transpose(), residuals[i], weights[i]);
    return equations;
  }
};

Problem random_problem(std::uint64_t seed, int measurements = 30) {
  Random random(seed);
  Problem problem{Eigen::MatrixXd(measurements, fit_unknowns), Eigen::VectorXd(measurements),
                  Eigen::VectorXd(measurements)};
  for (double& x : problem.rows.reshaped()) x = random.normal();
  for (double& x : problem.residuals) x = random.normal();
  for (double& x : problem.weights) x = random.uniform(0.1, 10);
  return problem;
}

TEST(NormalEquations, SolveLikeADenseLeastSquaresSolver) {
  for (std::uint64_t seed = 1; seed <= 7; ++seed) {
    const Problem p = random_problem(seed);
    const Eigen::MatrixXd scaled = p.weights.cwiseSqrt().asDiagonal() * p.rows;
    const Eigen::VectorXd expected =
        scaled.colPivHouseholderQr().solve(p.weights.cwiseSqrt().cwiseProduct(p.residuals));
    EXPECT_TRUE(p.equations().solve(0).isApprox(expected, 1e-9)) << "seed " << seed;
    EXPECT_TRUE(p.equations().information().isApprox(scaled.transpose() * scaled, 1e-12)) << "seed " << seed;
  }
}

TEST(NormalEquations, DampingScalesTheDiagonalAndDirectionsWithoutInformationGetNoStep) {
  Problem p = random_problem(12);
  p.rows.col(2).setZero();
  Eigen::MatrixXd without(p.rows.rows(), fit_unknowns - 1);
  without << p.rows.leftCols<2>(), p.rows.rightCols<4>();
  for (const double damping : {1e-4, 1e-3, 0.1, 10.0}) {
    const UnknownVector step = p.equations().solve(damping);
    EXPECT_EQ(step[2], 0);
    Eigen::MatrixXd damped = without.transpose() * p.weights.asDiagonal() * without;
    damped.diagonal() *= 1 + damping;
    const Eigen::VectorXd expected = damped.ldlt().solve(without.transpose() * p.weights.asDiagonal() * p.residuals);
    EXPECT_TRUE(step.head<2>().isApprox(expected.head<2>(), 1e-9)) << damping;
    EXPECT_TRUE(step.tail<4>().isApprox(expected.tail<4>(), 1e-9)) << damping;
  }
  EXPECT_TRUE(NormalEquations().solve(0).isZero());
}

// Iterative reweighting minimises a loss when the weight is its derivative over the residual: here Cauchy's
// c^2 / 2 log(1 + (x / c)^2).
TEST(NormalEquations, TheCauchyWeightIsThatOfItsLoss) {
  constexpr double scale = cauchy_scale_sigmas;
  const auto loss = [](double r) { return 0.5 * scale * scale * std::log1p(r * r / (scale * scale)); };
  for (double x = 0.05; x < 30; x *= 1.4) {
    const double h = 1e-5 * x;
    EXPECT_NEAR(cauchy_weight(x), (loss(x + h) - loss(x - h)) / (2 * h) / x, 1e-6);
    EXPECT_EQ(cauchy_weight(x), cauchy_weight(-x));
  }
}

}  // namespace lapservo::internal::normal_equations_test
