#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace lapservo::internal {

/// The four colour boundaries along a line of colour classes: position[k] samples lie before boundary k, all of them
/// before one that the line does not reach. `seen` when the samples on both its sides are what they should be.
struct LineSegmentation {
  std::array<double, 4> position{};
  std::array<bool, 4> seen{};
};

/// The most likely split of the line into shaft, three bands and shaft, by dynamic programming over the five states:
/// blood, highlights and noise inside a band cost a little but do not break it. `classes` run from proximal to distal;
/// Scene::outside counts for nothing. At most 512 samples.
LineSegmentation segment_line(std::span<const std::uint8_t> classes, const std::array<std::uint8_t, 3>& bands);

}  // namespace lapservo::internal
