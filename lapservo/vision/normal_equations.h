#pragma once

#include <cmath>

#include <Eigen/Cholesky>

#include "lapservo/vision/shaft_pose.h"

namespace lapservo {

/// Gauss-Newton's normal equations of a few unknowns, gathered one scalar measurement at a time.
class NormalEquations {
 public:
  explicit NormalEquations(int unknowns)
      : information_(UnknownMatrix::Zero(unknowns, unknowns)), gradient_(UnknownVector::Zero(unknowns)) {}

  /// residual = measured - predicted, row = d(predicted)/d(unknowns).
  void add(const UnknownVector& row, double residual, double weight) {
    information_.noalias() += weight * row * row.transpose();
    gradient_.noalias() += (weight * residual) * row;
  }

  const UnknownMatrix& information() const { return information_; }

  /// The step; `damping` scales the diagonal (Marquardt). Directions without information get no step.
  UnknownVector solve(double damping) const {
    UnknownMatrix damped = information_;
    const UnknownVector scale = information_.diagonal().cwiseMax(1e-12 * information_.diagonal().maxCoeff());
    damped.diagonal() += damping * scale;
    const UnknownVector step = damped.ldlt().solve(gradient_);
    return step.allFinite() ? step : UnknownVector::Zero(gradient_.size());
  }

 private:
  UnknownMatrix information_;
  UnknownVector gradient_;
};

/// Weight of a residual in units of its sigma under the Cauchy loss: 1 near zero, falling for outliers.
inline double cauchy_weight(double residual_sigmas, double scale_sigmas) {
  const double x = residual_sigmas / scale_sigmas;
  return 1 / (1 + x * x);
}

}  // namespace lapservo
