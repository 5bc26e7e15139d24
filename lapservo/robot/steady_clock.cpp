#include "lapservo/robot/steady_clock.h"

#include <chrono>
#include <thread>

namespace lapservo {

using Seconds = std::chrono::duration<double>;

double SteadyClock::now_s() const {
  return Seconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void SteadyClock::sleep_until(double time_s) {
  if (const double left_s = time_s - now_s(); left_s > 0) std::this_thread::sleep_for(Seconds(left_s));
}

}  // namespace lapservo
