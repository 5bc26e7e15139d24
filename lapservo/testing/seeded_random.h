#pragma once

#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::testing {

/// Random numbers whose seed is printed with each failure of their scope.
class SeededRandom : public internal::Random {
 public:
  /// `file`, `line`: of the caller; clang 14 has no std::source_location.
  explicit SeededRandom(std::uint64_t seed, const char* file = __builtin_FILE(), int line = __builtin_LINE())
      : Random(seed), trace_(file, line, "seed " + std::to_string(seed)) {}

 private:
  ::testing::ScopedTrace trace_;
};

}  // namespace lapservo::testing
