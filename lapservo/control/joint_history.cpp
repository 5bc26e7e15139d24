#include "lapservo/control/joint_history.h"

namespace lapservo::internal {

void JointHistory::push(double time_s, const Eigen::Vector4d& q) {
  if (size_ > 0 && !(time_s > newest_s())) return;
  if (size_ == capacity) {
    first_ = (first_ + 1) % capacity;
    --size_;
  }
  ring_[(first_ + size_) % capacity] = {time_s, q};
  ++size_;
}

bool JointHistory::pauses(double from_s, double to_s) const {
  constexpr double longest_s = 0.1;
  for (std::size_t i = size_; i-- > 1 && entry(i).time_s >= from_s;)
    if (entry(i - 1).time_s <= to_s && entry(i).time_s - entry(i - 1).time_s > longest_s) return true;
  return false;
}

std::optional<Eigen::Vector4d> JointHistory::at(double time_s) const {
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

}  // namespace lapservo::internal
