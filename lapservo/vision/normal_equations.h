#pragma once

#include <array>
#include <cmath>

#include <Eigen/Cholesky>

#include "lapservo/vision/shaft_pose.h"

namespace lapservo {

/// Gauss-Newton's normal equations of a few unknowns, gathered one scalar measurement at a time.
class NormalEquations {
 public:
  explicit NormalEquations(int unknowns) : unknowns_(unknowns) {}

  /// residual = measured - predicted, row = d(predicted)/d(unknowns).
  void add(const UnknownVector& row, double residual, double weight) {
    switch (unknowns_) {  // loops of fixed length are several times faster
      case 4:
        return add_fixed<4>(row.data(), residual, weight);
      case 5:
        return add_fixed<5>(row.data(), residual, weight);
      case 6:
        return add_fixed<6>(row.data(), residual, weight);
      case 7:
        return add_fixed<7>(row.data(), residual, weight);
      default:
        return add_some(unknowns_, row.data(), residual, weight);
    }
  }

  UnknownMatrix information() const {
    UnknownMatrix information(unknowns_, unknowns_);
    for (int i = 0; i < unknowns_; ++i)
      for (int j = 0; j <= i; ++j) information(i, j) = information(j, i) = lower_[i][j];
    return information;
  }

  /// The step; `damping` scales the diagonal (Marquardt). Directions without information get no step.
  UnknownVector solve(double damping) const {
    UnknownMatrix damped = information();
    const UnknownVector diagonal = damped.diagonal();
    damped.diagonal() += damping * diagonal.cwiseMax(1e-12 * diagonal.maxCoeff());
    const UnknownVector step = damped.ldlt().solve(Eigen::Map<const UnknownVector>(gradient_.data(), unknowns_));
    return step.allFinite() ? step : UnknownVector::Zero(unknowns_);
  }

 private:
  template <int Unknowns>
  void add_fixed(const double* row, double residual, double weight) {
    add_some(Unknowns, row, residual, weight);
  }
  [[gnu::always_inline]] void add_some(int unknowns, const double* row, double residual, double weight) {
    for (int i = 0; i < unknowns; ++i) {
      const double weighted = weight * row[i];
      for (int j = 0; j <= i; ++j) lower_[i][j] += weighted * row[j];
      gradient_[i] += weighted * residual;
    }
  }

  int unknowns_;
  std::array<std::array<double, max_unknowns>, max_unknowns> lower_{};
  std::array<double, max_unknowns> gradient_{};
};

/// Weight of a residual in units of its sigma under the Cauchy loss: 1 near zero, falling for outliers.
inline double cauchy_weight(double residual_sigmas, double scale_sigmas) {
  const double x = residual_sigmas / scale_sigmas;
  return 1 / (1 + x * x);
}

}  // namespace lapservo
