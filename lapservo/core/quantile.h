#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace lapservo::internal {

/// The value below which a fraction of the numbers lies, between two of them on the straight line; 0 when there are
/// none.
inline double quantile_of(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const double place = fraction * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place), above = std::min(below + 1, values.size() - 1);
  return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
}

}  // namespace lapservo::internal
