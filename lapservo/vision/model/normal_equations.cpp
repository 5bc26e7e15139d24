// Apart from the header: each file that decomposes a matrix compiles Eigen's code for it, for long under sanitizers.
#include "lapservo/vision/model/normal_equations.h"

#include <limits>

#include <Eigen/Cholesky>

namespace lapservo::internal {

UnknownMatrix NormalEquations::information() const {
  UnknownMatrix information;
  for (int i = 0; i < fit_unknowns; ++i)
    for (int j = 0; j <= i; ++j) information(i, j) = information(j, i) = lower_[i][j];
  return information;
}

UnknownVector NormalEquations::solve(double damping) const {
  UnknownMatrix damped = information();
  const UnknownVector diagonal = damped.diagonal();
  damped.diagonal() += damping * diagonal.cwiseMax(1e-12 * diagonal.maxCoeff());
  const UnknownVector step = damped.ldlt().solve(Eigen::Map<const UnknownVector>(gradient_.data()));
  return step.allFinite() ? step : UnknownVector::Zero();
}

std::optional<UnknownMatrix> inverse_of(const UnknownMatrix& information) {
  // Scaled to a diagonal of ones: the unknowns have different units.
  if (!(information.diagonal().array() > 0).all() || !information.allFinite()) return std::nullopt;
  const UnknownVector scale = information.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<UnknownMatrix> factor(scale.asDiagonal() * information * scale.asDiagonal());
  const double rounding = fit_unknowns * std::numeric_limits<double>::epsilon();
  if (!(factor.vectorD().minCoeff() > rounding)) return std::nullopt;
  const UnknownMatrix inverse = factor.solve(UnknownMatrix::Identity());
  return scale.asDiagonal() * inverse * scale.asDiagonal();
}

}  // namespace lapservo::internal
