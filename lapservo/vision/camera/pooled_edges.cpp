#include "lapservo/vision/camera/pooled_edges.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

struct EdgePlace {
  std::array<std::array<float, PooledEdge::samples>, 3> value;
  float brightness = 0;
  const Measurement* measurement = nullptr;

  EdgePlace() {}  // NOLINT(modernize-use-equals-default): the values are left as they are
};
using EdgePlaces = InplaceVector<EdgePlace, EdgeMeasurements::max_lines>;

// Weights of four pixels in a row for a place a fraction of a pixel beyond the second: cubic convolution (Keys, 1981).
std::array<float, 4> cubic_weights(float f) {
  constexpr float a = -0.5F;
  const float g = 1 - f;
  const auto inner = [](float x) { return 1 + x * x * ((a + 2) * x - (a + 3)); };
  return {a * f * g * g, inner(f), inner(g), a * g * f * f};
}

// Encoded values of some channels at a place: as linear as the filters that cameras apply to them.
template <std::size_t First, std::size_t Last>
void sample_cubic(const ImageView& image, float u, float v, std::size_t sample, EdgePlace& place) {
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const auto across = cubic_weights(u - static_cast<float>(iu)), down = cubic_weights(v - static_cast<float>(iv));
  std::array<float, 3> sum{};
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) {
      const std::uint8_t* pixel =
          image.pixel(std::clamp(iu + x - 1, 0, image.width_px - 1), std::clamp(iv + y - 1, 0, image.height_px - 1));
      const float weight = across[static_cast<std::size_t>(x)] * down[static_cast<std::size_t>(y)];
      for (std::size_t c = First; c < Last; ++c) sum[c] += weight * static_cast<float>(pixel[c]);
    }
  for (std::size_t c = First; c < Last; ++c) place.value[c][sample] = sum[c];
}

template <std::size_t First, std::size_t Last>
void sample_linear(const ImageView& image, float u, float v, std::size_t sample, EdgePlace& place) {
  const int iu = static_cast<int>(u), iv = static_cast<int>(v);
  const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
  const float w11 = fu * fv, w01 = fu - w11, w10 = fv - w11, w00 = 1 - fu - w10;
  const std::uint8_t* top = image.pixel(iu, iv);
  const std::uint8_t* bottom = top + image.row_bytes;
  for (std::size_t c = First; c < Last; ++c)
    place.value[c][sample] = (w00 * static_cast<float>(top[c]) + w01 * static_cast<float>(top[c + 3]) +
                              w10 * static_cast<float>(bottom[c]) + w11 * static_cast<float>(bottom[c + 3]));
}

void sample_at(const LightImage& light, const Eigen::Vector2f& at, Look look, std::size_t sample, EdgePlace& place) {
  if (look == Look::light) {
    const LightImage::Sample seen = light.at(at.x(), at.y());
    for (std::size_t c = 0; c < 3; ++c) place.value[c][sample] = 255 * seen.light[c];
    return;
  }
  light.channels().for_each_place(at.x(), at.y(), [&]<std::size_t First, std::size_t Last>(float u, float v) {
    look == Look::closely ? sample_cubic<First, Last>(light.image(), u, v, sample, place)
                          : sample_linear<First, Last>(light.image(), u, v, sample, place);
  });
}

// Places of a boundary, spread evenly over all that were located.
EdgePlaces places_of(std::size_t boundary, const LightImage& light, std::span<const Measurement> measurements,
                     Look look) {
  constexpr double farthest_px = 1;  // from most of the places: beyond, something else was located
  InplaceVector<const Measurement*, EdgeMeasurements::max_lines> located;
  InplaceVector<double, EdgeMeasurements::max_lines> residuals_px;
  for (const Measurement& m : measurements)
    if (m.group == boundary) located.push_back(&m), residuals_px.push_back(m.residual_px);
  const int count = static_cast<int>(located.size());
  // Where not at all: at as many as every pass has lines, or at twice as many.
  const int most =
      look == Look::closely ? EdgeMeasurements::max_lines : (look == Look::light ? 2 : 1) * edge_limits.min_lines;
  const bool glances = look == Look::glance;  // which is to cost little
  const double middle_px = glances || located.empty() ? 0 : median(residuals_px);
  EdgePlaces places;
  int seen = 0;
  for (const Measurement* m : located) {
    if (seen++ * most % std::max(count, most) >= most) continue;
    if (!glances && std::abs(m->residual_px - middle_px) > farthest_px) continue;
    const Eigen::Vector2f reach = static_cast<float>(PooledEdge::reach) * m->normal;
    const Eigen::Vector2f first = m->expected_px - reach, last = m->expected_px + reach;
    if (!light.contains(first.cast<double>()) || !light.contains(last.cast<double>())) continue;
    EdgePlace& place = places.emplace_back();
    place.measurement = m;
    for (std::size_t k = 0; k < PooledEdge::samples; ++k)
      sample_at(light, first + static_cast<float>(k) * m->normal, look, k, place);
    for (const auto& channel : place.value)
      if (look == Look::closely) place.brightness = std::accumulate(channel.begin(), channel.end(), place.brightness);
  }
  return places;
}

PooledEdge mean_of(std::span<const EdgePlace> places) {
  PooledEdge edge;
  edge.places = static_cast<int>(places.size());
  const float part = 1 / static_cast<float>(255 * edge.places);
  for (const EdgePlace& place : places) {
    const Measurement& m = *place.measurement;
    edge.boundary = m.group;
    edge.residual_px += m.residual_px / edge.places;
    edge.channel_px += Eigen::Map<const Eigen::Array3f>(m.channel_px.data()).cast<double>() / edge.places;
    edge.place_px += m.expected_px, edge.normal += m.normal;
    edge.clear_px = std::clamp(static_cast<int>(m.clear_px), 0, edge.clear_px);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t i = 0; i < PooledEdge::samples; ++i) edge.value[c][i] += part * place.value[c][i];
  }
  edge.place_px /= static_cast<float>(edge.places), edge.normal /= static_cast<float>(edge.places);
  return edge;
}

// The loss by cubic convolution between pixels, in the mean over all places between them: of its kernel the second
// moment is 0, the fourth -0.3, and a fourth difference counts by that over 4!.
void undo_cubic(PooledEdge& edge) {
  constexpr float lost = 0.0125F;
  const Eigen::Array2f squares = edge.normal.array().square();
  const float part = lost * squares.square().sum() / (squares.sum() * squares.sum());
  for (auto& value : edge.value) {
    const auto v = value;
    // At the ends it is even.
    for (std::size_t i = 2; i + 2 < v.size(); ++i)
      value[i] += part * (v[i - 2] - 4 * v[i - 1] + 6 * v[i] - 4 * v[i + 1] + v[i + 2]);
  }
}

}  // namespace

PooledEdges pool_edges(const LightImage& light, std::span<const Measurement> measurements, Look look) {
  const std::size_t most_levels = look == Look::closely ? max_brightness_levels : 1;
  PooledEdges edges;
  for (std::size_t boundary = 0; boundary < 4; ++boundary) {
    EdgePlaces places = places_of(boundary, light, measurements, look);
    const std::size_t count =
        std::clamp<std::size_t>(places.size() / std::size_t{PooledEdge::min_places}, 1, most_levels);
    if (count > 1) std::ranges::sort(places, {}, &EdgePlace::brightness);
    for (std::size_t level = 0; level < count && !places.empty(); ++level) {
      const std::size_t first = level * places.size() / count, last = (level + 1) * places.size() / count;
      const std::span<const EdgePlace> alike(places.begin() + first, last - first);
      PooledEdge edge = mean_of(alike);
      if (look == Look::closely) undo_cubic(edge);
      for (std::size_t i = 0; i < alike.size() && edge.is_seen(); ++i)
        edges.of_measurement[static_cast<std::size_t>(alike[i].measurement - measurements.data())] =
            static_cast<std::uint8_t>(edges.all.size());
      edges.all.push_back(edge);
    }
  }
  return edges;
}

std::array<double, 4> magnitudes_px(const std::array<std::optional<double>, 4>& seen_px) {
  double worst_px = 0;
  for (const auto& px : seen_px) worst_px = std::max(worst_px, std::abs(px.value_or(0)));
  std::array<double, 4> out;
  std::ranges::transform(seen_px, out.begin(), [&](const auto& px) { return std::abs(px.value_or(worst_px)); });
  return out;
}

}  // namespace lapservo::internal
