#pragma once

#include <algorithm>
#include <utility>

#include "lapservo/robot/clock.h"

namespace lapservo {

/// Notices when the computer was suspended.
class SuspensionWatch {
 public:
  explicit SuspensionWatch(const Clock& clock) : clock_(clock), suspended_s_(clock.suspended_s()) {}
  /// Since the last call, or the beginning.
  bool was_suspended() {
    constexpr double adjustment_s = 0.05;  // that a clock may make by itself
    const double before_s = std::exchange(suspended_s_, std::max(suspended_s_, clock_.suspended_s()));
    return suspended_s_ - before_s > adjustment_s;
  }

 private:
  const Clock& clock_;
  double suspended_s_;
};

}  // namespace lapservo
