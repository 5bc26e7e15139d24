#pragma once

#include <cmath>
#include <vector>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {

/// Standard deviation of residuals that are normal but for outliers, by the median of their size; 1 of none.
inline double robust_scale(std::vector<double> residuals) {
  if (residuals.empty()) return 1;
  for (double& residual : residuals) residual = std::abs(residual);
  return median(residuals) / 0.6745;
}

}  // namespace lapservo::internal
