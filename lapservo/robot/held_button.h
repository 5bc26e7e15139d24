#pragma once

#include <atomic>
#include <limits>

namespace lapservo::internal {

/// A button that an operator has to press throughout: that it is pressed has to be said again and again. From any
/// thread.
class HeldButton {
 public:
  static constexpr double max_age_s = 0.2;

  void press(double time_s) { pressed_s_ = time_s; }
  void release() {
    released_ = true;
    pressed_s_ = never;
  }
  /// Throughout since the last call.
  bool was_held(double now_s) {
    const bool released = released_.exchange(false);
    return !released && now_s - pressed_s_ <= max_age_s;
  }

 private:
  static constexpr double never = -std::numeric_limits<double>::infinity();
  std::atomic<double> pressed_s_ = never;
  std::atomic<bool> released_ = false;
};

}  // namespace lapservo::internal
