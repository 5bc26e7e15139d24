#pragma once

#include <algorithm>
#include <bitset>
#include <cstddef>

#include "lapservo/core/angles.h"

namespace lapservo::internal {

/// Sides from which a print is seen: 15 degrees of tau each.
inline constexpr std::size_t print_sides = 24;
using PrintSides = std::bitset<print_sides>;

/// That of a generatrix which faces the camera; any angle.
inline std::size_t print_side(double tau_rad) {
  const auto side = static_cast<std::size_t>(wrap_two_pi(tau_rad) / two_pi * static_cast<double>(print_sides));
  return std::min(side, print_sides - 1);
}

}  // namespace lapservo::internal
