#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "lapservo/vision/scene.h"

namespace lapservo::internal {

/// What segment_line gains from a sample of a colour in a state: 0 shaft, 1..3 the bands, 4 shaft. Internal.
inline float line_reward(std::size_t state, std::uint8_t color, const std::array<std::uint8_t, 3>& bands) {
  if (color == Scene::outside) return 0;
  if (state == 0 || state == 4) return color == 0 ? 0.3F : -0.7F;
  if (color == bands[state - 1]) return 1;
  return color == 0 ? -0.35F : -1;
}

}  // namespace lapservo::internal
