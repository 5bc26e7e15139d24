#include "lapservo/core/dense_matrix.h"

#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace lapservo::internal {

Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a * b;
}

Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  return matrix.ldlt().solve(right);
}

Eigen::MatrixXd inverse_of_symmetric(const Eigen::MatrixXd& matrix) {
  const Eigen::LDLT<Eigen::MatrixXd> factor(matrix);
  const Eigen::Index size = matrix.rows();
  if (!(factor.vectorD().minCoeff() > 0))
    return Eigen::MatrixXd::Constant(size, size, std::numeric_limits<double>::quiet_NaN());
  return factor.solve(Eigen::MatrixXd::Identity(size, size));
}

Eigen::MatrixXd whitening_of(const Eigen::MatrixXd& covariance) {
  return inverse_of_symmetric(covariance).llt().matrixU();
}

Eigen::MatrixXd covariance_at_least(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& least) {
  // In units in which the least one is 1.
  const Eigen::LLT<Eigen::MatrixXd> factor(least);
  const Eigen::MatrixXd left = factor.matrixL().solve(covariance);
  const Eigen::MatrixXd normed = factor.matrixL().solve(left.transpose());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> parts((normed + normed.transpose()) / 2);
  const Eigen::MatrixXd directions = factor.matrixL() * parts.eigenvectors();
  return directions * parts.eigenvalues().cwiseMax(1).asDiagonal() * directions.transpose();
}

Eigen::VectorXd eigenvalues_of_symmetric(const Eigen::MatrixXd& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace lapservo::internal
