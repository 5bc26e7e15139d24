#pragma once

#include <chrono>
#include <thread>

namespace lapservo::testing {

/// Whether the condition holds within a minute, which is far more than what works takes on a busy computer.
template <typename Condition>
bool wait_for(const Condition& condition, std::chrono::microseconds interval = std::chrono::milliseconds(5)) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!condition() && std::chrono::steady_clock::now() < end) std::this_thread::sleep_for(interval);
  return condition();
}

inline void sleep(double duration_s) {
  std::this_thread::sleep_for(std::chrono::duration<double>(duration_s));
}

}  // namespace lapservo::testing
