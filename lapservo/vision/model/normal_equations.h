#pragma once

#include <array>
#include <optional>
#include <type_traits>

#include <Eigen/Core>

#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Gauss-Newton's normal equations of a few unknowns, gathered one scalar measurement at a time.
class NormalEquations {
 public:
  explicit NormalEquations(int unknowns) : unknowns_(unknowns) {}

  /// residual = measured - predicted, row = d(predicted)/d(unknowns). Rows of fixed size are several times faster.
  template <typename Row>
  void add(const Eigen::MatrixBase<Row>& row, double residual, double weight) {
    constexpr bool fixed = Row::SizeAtCompileTime != Eigen::Dynamic;
    // A copy, which no sum can alias, off the heap.
    const std::conditional_t<fixed, Eigen::Matrix<double, Row::SizeAtCompileTime, 1>, UnknownVector> local = row;
    const int count = fixed ? static_cast<int>(Row::SizeAtCompileTime) : unknowns_;
    for (int i = 0; i < count; ++i) {
      const double weighted = weight * local[i];
      for (int j = 0; j <= i; ++j) lower_[i][j] += weighted * local[j];
      gradient_[i] += weighted * residual;
    }
  }

  UnknownMatrix information() const;

  /// The step; `damping` scales the diagonal (Marquardt). Directions without information get no step.
  UnknownVector solve(double damping) const;

 private:
  int unknowns_;
  std::array<std::array<double, max_unknowns>, max_unknowns> lower_{};
  std::array<double, max_unknowns> gradient_{};
};

/// Of a symmetric positive definite matrix; nullopt when it is none to within rounding.
std::optional<UnknownMatrix> inverse_of(const UnknownMatrix& information);

/// Robust weights of all fits: the Cauchy loss' scale, and what is no inlier.
inline constexpr double cauchy_scale_sigmas = 2.5, inlier_sigmas = 5;

/// Weight of a residual in units of its sigma under the Cauchy loss: 1 near zero, falling for outliers.
inline double cauchy_weight(double residual_sigmas, double scale_sigmas) {
  const double x = residual_sigmas / scale_sigmas;
  return 1 / (1 + x * x);
}

}  // namespace lapservo::internal
