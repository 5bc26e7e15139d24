#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>

namespace lapservo::internal {

/// The one of at least one value that a `fraction` of all, 0 <= fraction < 1, stands before in order. Reorders the
/// values.
template <typename Values>
auto quantile(Values&& values, double fraction) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size()));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Of at least one value; of an even number of them the upper one of both in the middle. Reorders the values.
template <typename Values>
auto median(Values&& values) {
  return quantile(values, 0.5);
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
