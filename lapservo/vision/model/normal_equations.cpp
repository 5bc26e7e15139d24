// Apart from the header: each file that decomposes a matrix compiles Eigen's code for it, for long under sanitizers.
#include "lapservo/vision/model/normal_equations.h"

#include <limits>

#include <Eigen/Cholesky>

namespace lapservo::internal {

UnknownVector NormalEquations::solve(double damping) const {
  UnknownMatrix damped = information();
  const UnknownVector diagonal = damped.diagonal();
  damped.diagonal() += damping * diagonal.cwiseMax(1e-12 * diagonal.maxCoeff());
  const UnknownVector step = damped.ldlt().solve(gradient_);
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
