#pragma once

namespace lapservo {

/// The time by which joint states and images are stamped and the loop keeps its ticks. A simulation's passes only while
/// somebody sleeps.
class Clock {
 public:
  virtual ~Clock() = default;
  /// Seconds since an epoch of the clock's own; never runs backwards. Callable from every thread.
  virtual double now_s() const = 0;
  /// At least so many seconds now_s() has left out so far because the computer was suspended. Callable from every
  /// thread.
  virtual double suspended_s() const { return 0; }
  /// Returns at that time, or at once when it has passed. Called from the loop's thread only.
  virtual void sleep_until(double time_s) = 0;
};

}  // namespace lapservo
