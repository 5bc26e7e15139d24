#pragma once

namespace lapservo::internal {

/// The motion of least jerk from rest to rest over unit distance in unit time, `x` in 0..1 of it (quintic; Flash and
/// Hogan 1985): where it is then, and its derivatives.
struct MinimumJerk {
  static constexpr double position(double x) { return x * x * x * (10 + x * (6 * x - 15)); }
  static constexpr double rate(double x) { return 30 * x * x * (1 - x) * (1 - x); }
  static constexpr double acceleration(double x) { return 60 * x * (1 - x) * (1 - 2 * x); }
  static constexpr double peak_rate = 1.875;
};

}  // namespace lapservo::internal
