#include "lapservo/core/dense_matrix.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace lapservo::internal {

Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a * b;
}

Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  return matrix.ldlt().solve(right);
}

Eigen::MatrixXd whitening_of(const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd inverse =
      solve_symmetric(covariance, Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
  return inverse.llt().matrixU();
}

Eigen::VectorXd eigenvalues_of_symmetric(const Eigen::MatrixXd& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace lapservo::internal
