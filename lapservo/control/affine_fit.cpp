#include "lapservo/control/affine_fit.h"

#include <Eigen/Cholesky>

namespace lapservo::internal {

void AffineFit::add(const Eigen::Vector4d& x, const ImageVector& y) {
  Eigen::Matrix<double, 5, 1> regressor;
  regressor << 1, x;
  normal_.noalias() += regressor * regressor.transpose();
  mixed_.noalias() += regressor * y.transpose();
  squares_ += y.squaredNorm();
  ++samples_;
}

std::optional<AffineFit::Solution> AffineFit::solve() const {
  if (samples_ < 10) return std::nullopt;
  const Eigen::LDLT<Eigen::Matrix<double, 5, 5>> factor(normal_);
  // Each input must have moved by about 1 % of its scale, root of the mean square.
  if (factor.info() != Eigen::Success || factor.vectorD().minCoeff() < 1e-4 * samples_) return std::nullopt;
  const Eigen::Matrix<double, 5, 8> parameters = factor.solve(mixed_);
  Solution solution;
  solution.at_zero = parameters.row(0);
  solution.gradient = parameters.bottomRows<4>().transpose();
  solution.covariance = factor.solve(Eigen::Matrix<double, 5, 5>::Identity());
  solution.squares = squares_ - parameters.cwiseProduct(mixed_).sum();
  return solution;
}

}  // namespace lapservo::internal
