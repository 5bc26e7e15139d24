#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

/// A frame's values across one boundary, averaged over places where it was located: encoded values (or Look::light) in
/// [0, 1] along the boundary's normal, a pixel apart, sample `reach` where the pose has the boundary.
struct PooledEdge {
  static constexpr int reach = 6, samples = 2 * reach + 1;
  std::size_t boundary = 0;                           ///< 0 to 3
  std::array<std::array<float, samples>, 3> value{};  ///< b, g, r
  int places = 0;
  Eigen::Vector2f place_px{0, 0}, normal{0, 0};  ///< of the places, their means
  Eigen::Array3d channel_px{0, 0, 0};            ///< where b, g, r show the places from there: mean
  double residual_px = 0;                        ///< where the places were located, from where the pose has them: mean
  int clear_px = reach;  ///< so far on either side no other boundary shows, wherever it was located

  /// With fewer places it shows more noise than shape.
  static constexpr int min_places = 8, least_clear_px = 3;
  bool is_seen() const { return places >= min_places && clear_px >= least_clear_px; }
};

/// Places are averaged with others that are as bright: what is clipped in the light is not in the shade, and a mean of
/// both looks like neither. Darker levels come first.
inline constexpr int max_brightness_levels = 4;
struct PooledEdges {
  InplaceVector<PooledEdge, 4 * max_brightness_levels> all;
  /// For each measurement, at which of `all` it was averaged; nowhere where that is not seen.
  static constexpr std::uint8_t nowhere = 255;
  std::array<std::uint8_t, EdgeMeasurements::most> of_measurement;

  PooledEdges() { of_measurement.fill(nowhere); }
};

/// The averaged values: at a glance some places' encoded values, linear between pixels, which darkens what is bright
/// beside an edge, for an eighth of the time; closely, those of all places, cubic and by brightness; or light, linear
/// as in locate_edges, which has no bias but is no value that a camera's filters worked on.
enum class Look { glance, closely, light };

/// For the boundaries among `measurements`.
PooledEdges pool_edges(const LightImage& light, std::span<const Measurement> measurements, Look look);

/// How far each boundary may be moved, of those that were seen well: one that was not by as much as the worst of them.
std::array<double, 4> magnitudes_px(const std::array<std::optional<double>, 4>& seen_px);

}  // namespace lapservo::internal
