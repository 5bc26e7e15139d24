#pragma once

#include <array>
#include <cstddef>

namespace lapservo::internal {

/// The part of a pixel where a function is negative.
struct PixelCoverage {
  float fraction = 0;                ///< of the pixel's area
  float centre_x = 0, centre_y = 0;  ///< centroid, from the pixel's first corner, in [0, 1]; the middle when empty
};

/// From the function's values at the corners (0,0), (1,0), (1,1), (0,1), linear along the pixel's sides: exact for
/// straight edges.
inline PixelCoverage negative_part(const std::array<float, 4>& f) {
  constexpr std::array<std::array<float, 2>, 4> corner{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
  std::array<std::array<float, 2>, 8> polygon{};
  std::size_t n = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const std::size_t j = (i + 1) % 4;
    if (f[i] < 0) polygon[n++] = corner[i];
    if ((f[i] < 0) != (f[j] < 0)) {
      const float t = f[i] / (f[i] - f[j]);
      polygon[n++] = {corner[i][0] + t * (corner[j][0] - corner[i][0]),
                      corner[i][1] + t * (corner[j][1] - corner[i][1])};
    }
  }
  float twice_area = 0, x = 0, y = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const auto &p = polygon[i], &q = polygon[(i + 1) % n];
    const float cross = p[0] * q[1] - q[0] * p[1];
    twice_area += cross;
    x += cross * (p[0] + q[0]);
    y += cross * (p[1] + q[1]);
  }
  if (!(twice_area > 1e-6F)) return {0, 0.5F, 0.5F};
  return {0.5F * twice_area, x / (3 * twice_area), y / (3 * twice_area)};
}

/// Places within a pixel, a rank-1 lattice: each has a row and a column of its own, so edges along the axes are as fine
/// as any.
constexpr std::array<std::array<float, 2>, 32> make_sample_lattice() {
  std::array<std::array<float, 2>, 32> lattice{};
  for (std::size_t i = 0; i < lattice.size(); ++i)
    lattice[i] = {(static_cast<float>(i) + 0.5F) / lattice.size(),
                  (static_cast<float>((i * 19 + 7) % lattice.size()) + 0.5F) / lattice.size()};
  return lattice;
}
inline constexpr auto sample_lattice = make_sample_lattice();

/// Between a function's values at the corners (0,0), (1,0), (1,1), (0,1).
inline float within(const std::array<float, 4>& corner, float u, float v) {
  const float top = corner[0] + u * (corner[1] - corner[0]), bottom = corner[3] + u * (corner[2] - corner[3]);
  return top + v * (bottom - top);
}

}  // namespace lapservo::internal
