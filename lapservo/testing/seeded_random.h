#pragma once

#include <cstdint>
#include <source_location>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::testing {

/// Random numbers whose seed is printed with each failure of their scope.
class SeededRandom : public internal::Random {
 public:
  explicit SeededRandom(std::uint64_t seed, const std::source_location& place = std::source_location::current())
      : Random(seed), trace_(place.file_name(), static_cast<int>(place.line()), "seed " + std::to_string(seed)) {}

 private:
  ::testing::ScopedTrace trace_;
};

}  // namespace lapservo::testing
