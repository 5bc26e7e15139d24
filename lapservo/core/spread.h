#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace lapservo::internal {

/// Keeps some of many items, evenly spread over them, however many come.
template <typename Item>
class Spread {
 public:
  explicit Spread(std::size_t most) : most_(most) {}

  /// `make` returns the next item; it is called where that is kept.
  template <typename Make>
  void add(Make make) {
    if (seen_++ % every_ != 0) return;
    if (items_.size() == most_) {
      std::vector<Item> half;
      for (std::size_t i = 0; i < items_.size(); i += 2) half.push_back(std::move(items_[i]));
      items_ = std::move(half), every_ *= 2;
      if ((seen_ - 1) % every_ != 0) return;
    }
    items_.push_back(make());
  }
  const std::vector<Item>& items() const { return items_; }

 private:
  std::size_t most_, seen_ = 0, every_ = 1;
  std::vector<Item> items_;
};

}  // namespace lapservo::internal
