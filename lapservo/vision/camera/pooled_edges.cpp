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
  std::size_t measurement = 0;

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

template <std::size_t First, std::size_t Last>
void sample_at(const ImageView& image, float u, float v, Between between, std::size_t sample, EdgePlace& place) {
  between == Between::values_cubic ? sample_cubic<First, Last>(image, u, v, sample, place)
                                   : sample_linear<First, Last>(image, u, v, sample, place);
}

void sample_at(const LightImage& light, const Eigen::Vector2f& at, Between between, std::size_t sample,
               EdgePlace& place) {
  if (between == Between::light) {
    const LightImage::Sample seen = light.at(at.x(), at.y());
    for (std::size_t c = 0; c < 3; ++c) place.value[c][sample] = 255 * seen.light[c];
    return;
  }
  const ImageView& image = light.image();
  const ChannelGeometry& geometry = light.channels();
  if (!geometry.differs()) return sample_at<0, 3>(image, at.x(), at.y(), between, sample, place);
  const Eigen::Vector2f centre(geometry.centre_u, geometry.centre_v);
  const Eigen::Vector2f blue = centre + geometry.magnification[0] * (at - centre);
  const Eigen::Vector2f red = centre + geometry.magnification[2] * (at - centre);
  sample_at<0, 1>(image, blue.x(), blue.y(), between, sample, place);
  sample_at<1, 2>(image, at.x(), at.y(), between, sample, place);
  sample_at<2, 3>(image, red.x(), red.y(), between, sample, place);
}

using Located = InplaceVector<std::uint16_t, EdgeMeasurements::max_lines>;

std::array<Located, 4> located_on(std::span<const Measurement> measurements) {
  std::array<Located, 4> located;
  for (std::size_t i = 0; i < measurements.size(); ++i)
    if (measurements[i].group < 4) located[measurements[i].group].push_back(static_cast<std::uint16_t>(i));
  return located;
}

// Beyond this from most of a boundary's places something else was located.
constexpr double farthest_px = 1;

double median_residual_px(const Located& located, std::span<const Measurement> measurements) {
  InplaceVector<double, EdgeMeasurements::max_lines> residuals_px;
  for (const std::size_t i : located) residuals_px.push_back(measurements[i].residual_px);
  return residuals_px.empty() ? 0 : median(residuals_px);
}

// Places of a boundary, spread evenly over all that were located.
EdgePlaces places_of(const Located& located, const LightImage& light, std::span<const Measurement> measurements,
                     const Look& look) {
  const int count = static_cast<int>(located.size());
  const bool glances = look.between == Between::values && look.levels == 1;  // which is to cost little
  const double middle_px = glances ? 0 : median_residual_px(located, measurements);
  EdgePlaces places;
  int seen = 0;
  for (const std::size_t i : located) {
    if (seen++ * look.places % std::max(count, look.places) >= look.places) continue;
    const Measurement& m = measurements[i];
    if (!glances && std::abs(m.residual_px - middle_px) > farthest_px) continue;
    const Eigen::Vector2f reach = static_cast<float>(PooledEdge::reach) * m.normal;
    const Eigen::Vector2f first = m.expected_px - reach, last = m.expected_px + reach;
    if (!light.contains(first.cast<double>()) || !light.contains(last.cast<double>())) continue;
    EdgePlace& place = places.emplace_back();
    place.measurement = i;
    for (std::size_t k = 0; k < PooledEdge::samples; ++k)
      sample_at(light, first + static_cast<float>(k) * m.normal, look.between, k, place);
    for (const auto& channel : place.value)
      if (look.levels > 1) place.brightness = std::accumulate(channel.begin(), channel.end(), place.brightness);
  }
  return places;
}

PooledEdge mean_of(std::span<const EdgePlace* const> places, std::span<const Measurement> measurements) {
  PooledEdge edge;
  edge.places = static_cast<int>(places.size());
  const float part = 1 / static_cast<float>(255 * edge.places);
  for (const EdgePlace* place : places) {
    const Measurement& m = measurements[place->measurement];
    edge.boundary = m.group;
    edge.residual_px += m.residual_px / edge.places;
    edge.place_px += m.expected_px, edge.normal += m.normal;
    edge.clear_px = std::clamp(static_cast<int>(m.clear_px), 0, edge.clear_px);
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t i = 0; i < PooledEdge::samples; ++i) edge.value[c][i] += part * place->value[c][i];
  }
  edge.place_px /= static_cast<float>(edge.places), edge.normal /= static_cast<float>(edge.places);
  return edge;
}

// The loss by cubic convolution between pixels, in the mean over all places between them: of its kernel the second
// moment is 0, the fourth -0.3, and fourth differences have 24.
void undo_cubic(PooledEdge& edge) {
  constexpr float fourth_moment = -0.3F;
  const Eigen::Array2f squares = edge.normal.array().square();
  const float part = -fourth_moment / 24 * squares.square().sum() / (squares.sum() * squares.sum());
  for (auto& value : edge.value) {
    const auto v = value;
    // At the ends it is even.
    for (std::size_t i = 2; i + 2 < v.size(); ++i)
      value[i] += part * (v[i - 2] - 4 * v[i - 1] + 6 * v[i] - 4 * v[i + 1] + v[i + 2]);
  }
}

}  // namespace

PooledEdges pool_edges(const LightImage& light, std::span<const Measurement> measurements, const Look& look) {
  PooledEdges edges;
  for (const Located& located : located_on(measurements)) {
    const EdgePlaces places = places_of(located, light, measurements, look);
    InplaceVector<const EdgePlace*, EdgeMeasurements::max_lines> darkest_first;
    for (const EdgePlace& place : places) darkest_first.push_back(&place);
    const std::size_t count = std::clamp<std::size_t>(places.size() / std::size_t{PooledEdge::min_places}, 1,
                                                      static_cast<std::size_t>(look.levels));
    if (count > 1)
      std::sort(darkest_first.begin(), darkest_first.end(),
                [](const EdgePlace* a, const EdgePlace* b) { return a->brightness < b->brightness; });
    for (std::size_t level = 0; level < count && !places.empty(); ++level) {
      const std::size_t first = level * places.size() / count, last = (level + 1) * places.size() / count;
      const std::span<const EdgePlace* const> alike(darkest_first.begin() + first, last - first);
      for (const EdgePlace* place : alike)
        edges.of_measurement[place->measurement] = static_cast<std::uint8_t>(edges.all.size());
      PooledEdge edge = mean_of(alike, measurements);
      if (look.between == Between::values_cubic) undo_cubic(edge);
      edges.all.push_back(edge);
    }
  }
  return edges;
}

}  // namespace lapservo::internal
