#pragma once

#include <chrono>

namespace lapservo::internal {

/// The time that stamps of messages carry: seconds since 1970.
inline double since_1970_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

}  // namespace lapservo::internal
