#pragma once

#include <cstddef>
#include <vector>

#include "lapservo/tool/tool.h"

namespace lapservo::internal {

/// Readings of a wrist's joints, at rest but for the first, which has swung by so much. In a snake-like wrist the later
/// half repeats the first.
inline std::vector<double> simulated_wrist_rad(const Tool& tool, double swung_rad) {
  const std::size_t count = tool.wrist.size(), free = tool.snake_like ? (count + 1) / 2 : count;
  std::vector<double> readings;
  for (std::size_t i = 0; i < free; ++i) readings.push_back((i % 2 == 0 ? 0.1 : -0.2) + (i == 0 ? swung_rad : 0));
  for (std::size_t i = free; i < count; ++i) readings.push_back(readings[count - 1 - i]);
  return readings;
}

}  // namespace lapservo::internal
