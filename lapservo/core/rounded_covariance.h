#pragma once

#include <Eigen/Core>
#include <fmt/format.h>

#include "lapservo/core/csv.h"

namespace lapservo::internal {

/// A covariance to six digits, as files hold it. Correlations are smaller by 1e-4, so that no rounding makes a variance
/// negative.
template <typename Covariance>
Covariance rounded_covariance(Covariance covariance) {
  constexpr double of_correlations = 1 - 1e-4;
  const auto variances = covariance.diagonal().eval();
  covariance *= of_correlations;
  covariance.diagonal() = variances;
  return covariance.unaryExpr([](double number) { return parse_finite(fmt::format("{:.6g}", number)).value(); });
}

}  // namespace lapservo::internal
