#include "lapservo/core/joint_units.h"

#include <cmath>
#include <cstddef>
#include <cstdio>

namespace lapservo::internal {

std::optional<Implausible> find_implausible(const std::array<double, 4>& values, const JointUnits& units) {
  constexpr std::size_t rho = 2;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!(std::abs(values[i]) > units.most[i])) continue;
    std::array<char, 128> expected{};
    std::snprintf(expected.data(), expected.size(), "%s within %.4g for number %zu: %g looks like %s",
                  i == rho ? "metres" : "radians", units.most[i], i + 1, values[i],
                  i == rho ? "millimetres" : "degrees");
    return Implausible{i, expected.data()};
  }
  return std::nullopt;
}

void expect_radians_and_metres(const YamlField& field, const std::array<double, 4>& values, const JointUnits& units) {
  if (const auto found = find_implausible(values, units)) field.fail(field.value_text(), found->expected);
}

}  // namespace lapservo::internal
