#include "lapservo/core/dense_matrix.h"

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::dense_matrix_test {

Eigen::MatrixXd random_matrix(int rows, int columns, Random& random) {
  Eigen::MatrixXd matrix(rows, columns);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < columns; ++j) matrix(i, j) = random.uniform(-1, 1);
  return matrix;
}

TEST(DenseMatrix, ASolutionSolvesAndWhiteningMakesUnits) {
  Random random(3);
  for (const int size : {1, 2, 5, 9}) {
    const Eigen::MatrixXd root = random_matrix(size, size + 3, random), right = random_matrix(size, 2, random);
    const Eigen::MatrixXd covariance = product(root, root.transpose());
    EXPECT_TRUE(product(covariance, solve_symmetric(covariance, right)).isApprox(right, 1e-9)) << size;
    const Eigen::MatrixXd whitening = whitening_of(covariance);
    const Eigen::MatrixXd units = product(product(whitening, covariance), whitening.transpose());
    EXPECT_TRUE(units.isIdentity(1e-9)) << units;
    EXPECT_TRUE(whitening.isUpperTriangular(1e-12));
  }
}

TEST(DenseMatrix, ACovarianceGrowsWhereItIsTooSmallOnly) {
  const Eigen::MatrixXd covariance{{4, 0}, {0, 0.01}}, least{{1, 0}, {0, 1}};
  EXPECT_TRUE(covariance_at_least(covariance, least).isApprox(Eigen::MatrixXd{{4, 0}, {0, 1}}, 1e-12));
  Random random(4);
  const Eigen::MatrixXd root = random_matrix(5, 8, random);
  const Eigen::MatrixXd large = product(root, root.transpose());
  EXPECT_TRUE(covariance_at_least(large, 0.5 * large).isApprox(large, 1e-9));
  EXPECT_TRUE(covariance_at_least(0.5 * large, large).isApprox(large, 1e-9));
}

TEST(DenseMatrix, WhatHasNoInverseGetsNone) {
  const Eigen::MatrixXd regular{{2, 1}, {1, 3}}, singular{{2, 0, 0}, {0, 0, 0}, {0, 0, 3}}, indefinite{{1, 0}, {0, -1}};
  EXPECT_TRUE(product(regular, inverse_of_symmetric(regular)).isIdentity(1e-12));
  EXPECT_TRUE(inverse_of_symmetric(singular).array().isNaN().all());
  EXPECT_TRUE(inverse_of_symmetric(indefinite).array().isNaN().all());
}

}  // namespace lapservo::internal::dense_matrix_test
