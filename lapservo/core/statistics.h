#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <type_traits>
#include <utility>
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

/// Standard deviation of residuals that are normal but for outliers, by the median of their size; 1 of none.
inline double robust_scale(std::vector<double> residuals) {
  if (residuals.empty()) return 1;
  for (double& residual : residuals) residual = std::abs(residual);
  return median(residuals) / 0.6745;
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

/// Root mean square without the tenth that is largest.
inline double rms_but_tenth(std::vector<double> sizes) {
  std::sort(sizes.begin(), sizes.end());
  sizes.resize(sizes.size() - sizes.size() / 10);
  return rms(sizes);
}

/// The items' values, in their order. `value`: a member or a function of an item.
template <typename Items, typename Value>
auto values_of(const Items& items, Value value) {
  std::vector<std::decay_t<std::invoke_result_t<Value, decltype(*items.begin())>>> values;
  for (const auto& item : items) values.push_back(std::invoke(value, item));
  return values;
}

/// So many items at most, evenly spread over them.
template <typename Item>
std::vector<Item> some_of(std::vector<Item> items, std::size_t most) {
  if (items.size() <= most) return items;
  std::vector<Item> some;
  for (std::size_t i = 0; i < most; ++i) some.push_back(std::move(items[i * items.size() / most]));
  return some;
}

}  // namespace lapservo::internal
