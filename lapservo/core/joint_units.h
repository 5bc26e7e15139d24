#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {

/// Largest plausible amounts of four joint values, theta, phi, rho, psi: rad and m, per second, per square second.
struct JointUnits {
  std::array<double, 4> most;
};
inline constexpr JointUnits joint_positions{{6.2832, 6.2832, 1, 12.5664}};
inline constexpr JointUnits joint_rates{{10, 10, 1, 15}};
inline constexpr JointUnits joint_accelerations{{60, 60, 6, 150}};

/// The first of four values that is larger, and the amount and unit that are expected instead of degrees or
/// millimetres.
struct Implausible {
  std::size_t number;
  std::string expected;
};
std::optional<Implausible> find_implausible(const std::array<double, 4>& values, const JointUnits& units);

/// Throws InputError with the field, the value and the unit that it looks like, degrees or millimetres, where one of
/// four values in radians and metres is larger.
void expect_radians_and_metres(const YamlField& field, const std::array<double, 4>& values, const JointUnits& units);

}  // namespace lapservo::internal
