#pragma once

#include <cstdlib>

namespace lapservo::testing {

/// A whole number from an environment variable, by which a test is made longer.
inline int from_environment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text ? std::atoi(text) : otherwise;
}

}  // namespace lapservo::testing
