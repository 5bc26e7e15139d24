#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace lapservo::internal {

/// So many at most, evenly spread over them.
template <typename Item>
std::vector<Item> some_of(std::vector<Item> items, std::size_t most) {
  if (items.size() <= most) return items;
  std::vector<Item> some;
  for (std::size_t i = 0; i < most; ++i) some.push_back(std::move(items[i * items.size() / most]));
  return some;
}

}  // namespace lapservo::internal
