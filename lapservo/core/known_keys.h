#pragma once

#include <string_view>
#include <vector>

#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {

inline constexpr auto sigmas_expected = "standard deviations: numbers from 0 up, as many as they belong to";

/// The keys that a map may have.
struct KnownKeys {
  std::vector<std::string_view> words;
  /// For these keys `sigma_KEY` is known, too: one standard deviation of each of KEY's numbers.
  std::vector<std::string_view> measured;
};

/// Refuses keys that no reader uses. Throws InputError when the map has an unknown key (naming the nearest known one),
/// a repeated key, a key without a value, or a sigma that is invalid or stands alone. Accepts a `map` that is missing
/// or no map: the reader of its fields reports that.
void expect_keys(const YamlField& map, const KnownKeys& known);

}  // namespace lapservo::internal
