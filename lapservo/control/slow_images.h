#pragma once

#include <bitset>
#include <cstddef>

namespace lapservo::internal {

/// Whether images usually come too seldom: more than half of the latest ones came after the loop had held for the age
/// of the one before. Pauses between images that are often enough are not that.
class SlowImages {
 public:
  /// A usable image; `late`: the one before was too old already.
  void add(bool late) {
    latest_ = latest_ << 1;
    latest_[0] = late;
    slow_ = latest_.count() >= (slow_ ? few_ : many_);
  }
  bool are_slow() const { return slow_; }

 private:
  static constexpr std::size_t many_ = 6, few_ = 3;  // of the latest; slow until fewer than these
  std::bitset<8> latest_;
  bool slow_ = false;
};

}  // namespace lapservo::internal
