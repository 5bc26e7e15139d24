#pragma once

#include <cstdlib>
#include <string>

namespace lapservo::internal {

/// A variable of the environment; empty where it is unset.
inline std::string environment(const char* name) {
  const char* const value = std::getenv(name);
  return value ? value : "";
}

}  // namespace lapservo::internal
