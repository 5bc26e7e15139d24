#pragma once

#include <string_view>
#include <vector>

#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {

inline constexpr auto sigmas_expected = "standard deviations: numbers from 0 up, as many as they belong to";

/// The keys that a map may have.
struct KnownKeys {
  std::vector<std::string_view> words;
  /// Of these, `sigma_KEY` too: one standard deviation of each of KEY's numbers.
  std::vector<std::string_view> measured;
};

/// What is not read must not stand in a file as if it were. Throws InputError when the map has an unknown key (naming
/// the nearest known one), a key twice, a key without a value, or a sigma that is none or stands alone. Where `map` is
/// missing or no map, nothing is said: who reads its fields will.
void expect_keys(const YamlField& map, const KnownKeys& known);

}  // namespace lapservo::internal
