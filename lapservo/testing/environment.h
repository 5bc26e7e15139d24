#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace lapservo::testing {

/// A whole number from an environment variable, by which a test is made longer.
inline int from_environment(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  return text ? std::atoi(text) : otherwise;
}

/// Seeds, one after the other: how many, and the first one (1), from environment variables.
inline std::vector<std::uint64_t> seeds_from_environment(const char* count, const char* first, int otherwise = 1) {
  std::vector<std::uint64_t> seeds(static_cast<std::size_t>(from_environment(count, otherwise)));
  auto seed = static_cast<std::uint64_t>(from_environment(first, 1));
  for (std::uint64_t& one : seeds) one = seed++;
  return seeds;
}

}  // namespace lapservo::testing
