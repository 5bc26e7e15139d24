#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "lapservo/vision/colour/colour_evidence.h"
#include "lapservo/vision/shaft/scene.h"

namespace lapservo::internal {

/// The four colour boundaries along a line of colour classes: position[k] samples lie before boundary k, all of them
/// before one that the line does not reach. `seen` when the samples on both its sides are what they should be. `score`:
/// the gain of the samples between the ends.
struct LineSegmentation {
  std::array<double, 4> position{};
  std::array<bool, 4> seen{};
  double score = 0;
};

/// The most likely split of the line into shaft, three bands and shaft, by dynamic programming over the five states:
/// blood, highlights and noise inside a band cost a little but do not break it. `classes` run from proximal to distal;
/// Scene::outside counts for nothing.
LineSegmentation segment_line(std::span<const std::uint8_t> classes, const std::array<std::uint8_t, 3>& bands);

/// The gain of segment_line from a sample of a colour in a state: 0 shaft, 1..3 the bands, 4 shaft. Internal.
inline float line_reward(std::size_t state, std::uint8_t colour, const std::array<std::uint8_t, 3>& bands) {
  if (colour == Scene::outside) return 0;
  const Place place = state == 0 || state == 4 ? Place::shaft : Place::band;
  if (colour == 0) return static_cast<float>(colour_evidence.of_none(place));
  const bool is_its = place == Place::band && colour == bands[state - 1];
  return static_cast<float>(colour_evidence.of(place, is_its ? Shows::its_band : Shows::another_band));
}

}  // namespace lapservo::internal
