#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

namespace lapservo::internal {

/// Blurred edges at a distance u in sigmas (inside: u > 0): the convolution of the normal density with the step and,
/// for the occluding contour of a shaded cylinder, with the square root and the 3/2 power of max(0, u).
struct BlurredEdge {
  float density, step, root, three_halves;
  float root_slope;  ///< d(root)/du
};

/// Tabulates them; errors below 1e-4. Beyond the table, density and step are those of its ends.
struct BlurredEdges {
  /// Entry i holds u = first_u + i / per_sigma, up to last_u and one beyond.
  static constexpr float first_u = -6, last_u = 8;
  static constexpr int per_sigma = 64;
  std::array<BlurredEdge, static_cast<std::size_t>((last_u - first_u) * per_sigma) + 2> entries;

  BlurredEdges();
  /// The one table.
  static const BlurredEdges& instance();

  BlurredEdge at(float u) const {
    const float place = (std::min(std::max(first_u, u), last_u) - first_u) * per_sigma;  // that of first_u for NaN
    const auto i = static_cast<std::size_t>(place);
    const float f = place - static_cast<float>(i);
    const BlurredEdge &a = entries[i], &b = entries[i + 1];
    return {a.density + f * (b.density - a.density), a.step + f * (b.step - a.step), a.root + f * (b.root - a.root),
            a.three_halves + f * (b.three_halves - a.three_halves), a.root_slope + f * (b.root_slope - a.root_slope)};
  }
};

}  // namespace lapservo::internal
