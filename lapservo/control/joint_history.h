#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include <Eigen/Core>

namespace lapservo::internal {

/// The latest measured joints in order of time, so that an image can be compared with where the joints were when it was
/// taken. A ring of fixed size: 1 s at 1 kHz; no allocation.
class JointHistory {
 public:
  static constexpr std::size_t capacity = 1024;

  /// Measured joints that are not newer than the last one are ignored.
  void push(double time_s, const Eigen::Vector4d& q) {
    if (size_ > 0 && !(time_s > newest_s())) return;
    if (size_ == capacity) {
      first_ = (first_ + 1) % capacity;
      --size_;
    }
    ring_[(first_ + size_) % capacity] = {time_s, q};
    ++size_;
  }
  void clear() { size_ = 0; }

  std::size_t size() const { return size_; }
  double oldest_s() const { return entry(0).time_s; }          ///< only when size() > 0
  double newest_s() const { return entry(size_ - 1).time_s; }  ///< only when size() > 0

  /// nullopt when there is none.
  std::optional<Eigen::Vector4d> newest() const { return size_ ? std::optional(entry(size_ - 1).q) : std::nullopt; }
  /// Linear interpolation; the newest reading for times after it, nullopt for times before the oldest.
  std::optional<Eigen::Vector4d> at(double time_s) const {
    if (size_ == 0 || !(time_s >= oldest_s())) return std::nullopt;
    if (time_s >= newest_s()) return entry(size_ - 1).q;
    std::size_t before = 0, after = size_ - 1;  // entry(before) <= time < entry(after)
    while (after - before > 1) {
      const std::size_t middle = (before + after) / 2;
      (entry(middle).time_s <= time_s ? before : after) = middle;
    }
    const Entry &a = entry(before), &b = entry(after);
    return a.q + (b.q - a.q) * ((time_s - a.time_s) / (b.time_s - a.time_s));
  }

  /// Whether the readings pause for more than 0.1 s somewhere within [from_s, to_s]: how joints moved meanwhile is
  /// not known.
  bool pauses(double from_s, double to_s) const {
    constexpr double longest_s = 0.1;
    for (std::size_t i = size_; i-- > 1 && entry(i).time_s >= from_s;)
      if (entry(i - 1).time_s <= to_s && entry(i).time_s - entry(i - 1).time_s > longest_s) return true;
    return false;
  }

  /// Calls visit(q) for the measured joints from after `from_s` up to `to_s`, in order.
  template <class Visit>
  void visit(double from_s, double to_s, const Visit& visit) const {
    std::size_t first = size_;
    while (first > 0 && entry(first - 1).time_s > from_s) --first;
    for (; first < size_ && entry(first).time_s <= to_s; ++first) visit(entry(first).q);
  }

 private:
  struct Entry {
    double time_s = 0;
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
  };
  const Entry& entry(std::size_t age_rank) const { return ring_[(first_ + age_rank) % capacity]; }

  std::array<Entry, capacity> ring_;
  std::size_t first_ = 0, size_ = 0;
};

}  // namespace lapservo::internal
