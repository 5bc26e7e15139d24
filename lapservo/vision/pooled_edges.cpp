#include "lapservo/vision/pooled_edges.h"

#include <algorithm>
#include <cstdint>

namespace lapservo::internal {
namespace {

// Encoded values of some channels at a place, bilinear: as linear as the filters that cameras apply to them.
template <std::size_t First, std::size_t Last>
void add_values(const ImageView& image, float u, float v, std::size_t sample, PooledEdge& edge) {
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
  const float w11 = fu * fv, w01 = fu - w11, w10 = fv - w11, w00 = 1 - fu - w10;
  const std::uint8_t* top = image.pixel(iu, iv);
  const std::uint8_t* bottom = top + image.row_bytes;
  for (std::size_t c = First; c < Last; ++c)
    edge.value[c][sample] += w00 * static_cast<float>(top[c]) + w01 * static_cast<float>(top[c + 3]) +
                             w10 * static_cast<float>(bottom[c]) + w11 * static_cast<float>(bottom[c + 3]);
}

void add_values(const LightImage& light, const Eigen::Vector2f& at, std::size_t sample, PooledEdge& edge) {
  const ImageView& image = light.image();
  const ChannelGeometry& channels = light.channels();
  if (!channels.differs()) return add_values<0, 3>(image, at.x(), at.y(), sample, edge);
  const Eigen::Vector2f centre(channels.centre_u, channels.centre_v);
  const Eigen::Vector2f blue = centre + channels.magnification[0] * (at - centre);
  const Eigen::Vector2f red = centre + channels.magnification[2] * (at - centre);
  add_values<0, 1>(image, blue.x(), blue.y(), sample, edge);
  add_values<1, 2>(image, at.x(), at.y(), sample, edge);
  add_values<2, 3>(image, red.x(), red.y(), sample, edge);
}

}  // namespace

PooledEdges pool_edges(const LightImage& light, std::span<const Measurement> measurements, int most) {
  PooledEdges edges;
  std::array<int, 4> located{}, seen{};
  for (const Measurement& m : measurements)
    if (m.group < 4) ++located[m.group];
  for (const Measurement& m : measurements) {
    if (m.group >= 4) continue;
    // Spread evenly over all that were located.
    if (seen[m.group]++ * most % std::max(located[m.group], most) >= most) continue;
    const Eigen::Vector2f reach = static_cast<float>(PooledEdge::reach) * m.normal;
    const Eigen::Vector2f first = m.expected_px - reach, last = m.expected_px + reach;
    if (!light.contains(first.cast<double>()) || !light.contains(last.cast<double>())) continue;
    PooledEdge& edge = edges[m.group];
    edge.clear_px = std::clamp(static_cast<int>(m.clear_px), 0, edge.clear_px);
    for (std::size_t i = 0; i < PooledEdge::samples; ++i)
      add_values(light, first + static_cast<float>(i) * m.normal, i, edge);
    ++edge.places;
  }
  for (PooledEdge& edge : edges)
    for (auto& channel : edge.value)
      for (float& value : channel) value /= 255 * static_cast<float>(std::max(1, edge.places));
  return edges;
}

}  // namespace lapservo::internal
