#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace lapservo::internal {

/// The one of at least one value that a `fraction` of all, 0 <= fraction < 1, stands before in order. Reorders the
/// values.
template <typename Values>
auto quantile(Values&& values, double fraction) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size()));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Median of at least one value; the upper one of the middle pair of an even number of values. Reorders the values.
template <typename Values>
auto median(Values&& values) {
  return quantile(values, 0.5);
}

/// The number below which a fraction of the numbers lies, interpolated between two of them; 0 where there are none.
inline double quantile_of(std::vector<double> numbers, double fraction) {
  if (numbers.empty()) return 0;
  std::sort(numbers.begin(), numbers.end());
  const double place = fraction * static_cast<double>(numbers.size() - 1);
  const auto below = static_cast<std::size_t>(place), above = std::min(below + 1, numbers.size() - 1);
  return numbers[below] + (place - static_cast<double>(below)) * (numbers[above] - numbers[below]);
}

/// Root mean square of the items' values; 0 where there are none. `value`: a member or a function of an item.
template <typename Items, typename Value = std::identity>
double rms(const Items& items, Value value = {}) {
  double squares = 0;
  for (const auto& item : items) {
    const double one = std::invoke(value, item);
    squares += one * one;
  }
  return items.empty() ? 0 : std::sqrt(squares / static_cast<double>(items.size()));
}

}  // namespace lapservo::internal
