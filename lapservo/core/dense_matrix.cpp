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

Eigen::VectorXd eigenvalues_of_symmetric(const Eigen::MatrixXd& matrix) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace lapservo::internal
