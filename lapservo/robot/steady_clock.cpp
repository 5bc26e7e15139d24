#include "lapservo/robot/steady_clock.h"

#include <chrono>
#include <ctime>
#include <thread>

namespace lapservo {

using Seconds = std::chrono::duration<double>;

double SteadyClock::now_s() const {
  return Seconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double SteadyClock::suspended_s() const {
  const auto seconds = [](clockid_t clock) {
    std::timespec time{};
    clock_gettime(clock, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  };
  const double boot_s = seconds(CLOCK_BOOTTIME);  // first: a pause before the other clock is read counts as none
  return boot_s - seconds(CLOCK_MONOTONIC);
}

void SteadyClock::sleep_until(double time_s) {
  if (const double left_s = time_s - now_s(); left_s > 0) std::this_thread::sleep_for(Seconds(left_s));
}

}  // namespace lapservo
