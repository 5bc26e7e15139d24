#pragma once

#include <cmath>
#include <optional>

namespace lapservo::internal {

/// When frames were taken, by a clock that always goes on.
class FrameClock {
 public:
  /// A power of two, so that equal steps are equal in doubles.
  static constexpr double usual_period_s = 1.0 / 32;

  /// The next frame's time. Goes on by usual_period_s where its time is not known, or does not go on from the time
  /// before.
  double next(std::optional<double> time_s) {
    const double since_s = time_s && last_s_ ? *time_s - *last_s_ : 0;
    now_s_ += since_s > 0 && std::isfinite(since_s) ? since_s : usual_period_s;
    last_s_ = time_s;
    return now_s_;
  }

 private:
  double now_s_ = 0;
  std::optional<double> last_s_;
};

}  // namespace lapservo::internal
