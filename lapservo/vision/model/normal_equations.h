#pragma once

#include <optional>

#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// Gauss-Newton's normal equations of a fit's unknowns, gathered one scalar measurement at a time.
class NormalEquations {
 public:
  /// residual = measured - predicted, row = d(predicted)/d(unknowns).
  void add(const UnknownVector& row, double residual, double weight) {
    const UnknownVector weighted = weight * row;
    information_ += weighted.lazyProduct(row.transpose());
    gradient_ += residual * weighted;
  }

  const UnknownMatrix& information() const { return information_; }

  /// The step; `damping` scales the diagonal (Marquardt). Directions without information get no step.
  UnknownVector solve(double damping) const;

 private:
  UnknownMatrix information_ = UnknownMatrix::Zero();
  UnknownVector gradient_ = UnknownVector::Zero();
};

/// So much of a diagonal makes equations solvable that lack a direction, and hardly moves the others.
inline constexpr double ridge = 1e-9;

/// For a symmetric positive definite matrix; nullopt when it is none to within rounding.
std::optional<UnknownMatrix> inverse_of(const UnknownMatrix& information);

/// Robust weights of all fits: the Cauchy loss' scale, and what is no inlier.
inline constexpr double cauchy_scale_sigmas = 2.5, inlier_sigmas = 5;

/// Weight of a residual in units of its sigma under the Cauchy loss: 1 near zero, falling for outliers.
inline double cauchy_weight(double residual_sigmas) {
  const double x = residual_sigmas / cauchy_scale_sigmas;
  return 1 / (1 + x * x);
}

/// 1 / sigma^2 of a residual, less of outliers.
inline double robust_certainty(double residual, double sigma) {
  return cauchy_weight(residual / sigma) / (sigma * sigma);
}

}  // namespace lapservo::internal
