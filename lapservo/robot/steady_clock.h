#pragma once

#include "lapservo/robot/clock.h"

namespace lapservo {

/// The computer's monotonic clock (CLOCK_MONOTONIC), which nobody sets while the loop runs.
class SteadyClock : public Clock {
 public:
  double now_s() const override;
  double suspended_s() const override;
  void sleep_until(double time_s) override;
};

}  // namespace lapservo
