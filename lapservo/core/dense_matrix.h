#pragma once

#include <Eigen/Core>

namespace lapservo::internal {

/// Products and decompositions of matrices of any size, compiled once: each of Eigen's takes a compiler 2 to 8 seconds
/// in every file that has it. On the heap: nothing for what is done each frame.
Eigen::MatrixXd product(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b);

/// x of matrix * x = right, for a symmetric matrix that is positive or negative (semi-)definite. Where that is
/// singular, directions of which it says nothing may get 0.
Eigen::MatrixXd solve_symmetric(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

/// The inverse of a symmetric positive definite matrix; NaN for other matrices.
Eigen::MatrixXd inverse_of_symmetric(const Eigen::MatrixXd& matrix);

/// The upper triangular W with W^T W = covariance^-1, which makes errors of unit size of such errors.
Eigen::MatrixXd whitening_of(const Eigen::MatrixXd& covariance);

/// The covariance, made as large as another, positive definite one in the directions in which it is smaller.
Eigen::MatrixXd covariance_at_least(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& least);

/// In rising order.
Eigen::VectorXd eigenvalues_of_symmetric(const Eigen::MatrixXd& matrix);

}  // namespace lapservo::internal
