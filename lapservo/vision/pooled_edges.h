#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "lapservo/vision/edge_measurements.h"
#include "lapservo/vision/light_image.h"

namespace lapservo::internal {

/// What a frame shows across one boundary, averaged over the places where it was located: encoded values in [0, 1]
/// along the boundary's normal, a pixel apart, sample `reach` where the pose has the boundary.
struct PooledEdge {
  static constexpr int reach = 6, samples = 2 * reach + 1;
  std::array<std::array<float, samples>, 3> value{};  ///< b, g, r
  int places = 0;                                     ///< 0: not seen
  int clear_px = reach;  ///< so far on either side no other boundary shows, wherever it was located
};
using PooledEdges = std::array<PooledEdge, 4>;

/// Of the boundaries among `measurements`, at most `most` places each.
PooledEdges pool_edges(const LightImage& light, std::span<const Measurement> measurements, int most);

}  // namespace lapservo::internal
