#pragma once

#include <algorithm>
#include <cstddef>

namespace lapservo::internal {

/// Of at least one value; of an even number of them the upper one of both in the middle. Reorders the values.
template <typename Values>
auto median(Values&& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace lapservo::internal
