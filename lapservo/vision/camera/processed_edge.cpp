#include "lapservo/vision/camera/processed_edge.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <type_traits>

#include "lapservo/vision/edges/blurred_edges.h"

namespace lapservo::internal {
namespace {

constexpr int edge_grid = PooledEdge::samples + 2 * both_filters_reach, half_grid = edge_grid / 2;

Filter gaussian(double sigma_px) {
  Filter filter;
  double sum = 0;
  for (std::size_t i = 0; i < filter.size(); ++i) {
    const double x = static_cast<double>(i) / sigma_px;
    filter[i] = std::exp(-x * x / 2);
    sum += i == 0 ? filter[i] : 2 * filter[i];
  }
  for (double& tap : filter) tap /= sum;
  return filter;
}

// Four passes over neighbours: linear in the variance near none.
Filter chroma_blur(double variance_px2) {
  const double side = variance_px2 / 8;
  Filter filter{1, 0, 0, 0, 0};
  for (int pass = 0; pass < filter_reach; ++pass) {
    const Filter before = filter;
    for (std::size_t i = 0; i < filter.size(); ++i) {
      const double inner = before[i == 0 ? 1 : i - 1], outer = i + 1 < before.size() ? before[i + 1] : 0;
      filter[i] = (1 - 2 * side) * before[i] + side * (inner + outer);
    }
  }
  return filter;
}

BothFilters convolved(const Filter& a, const Filter& b, double factor) {
  BothFilters both{};
  const auto tap = [](const Filter& filter, int i) {
    return std::abs(i) <= filter_reach ? filter[static_cast<std::size_t>(std::abs(i))] : 0;
  };
  for (int i = 0; i <= both_filters_reach; ++i)
    for (int k = -filter_reach; k <= filter_reach; ++k) both[static_cast<std::size_t>(i)] += tap(a, k) * tap(b, i - k);
  for (double& t : both) t *= factor;
  return both;
}

template <typename A, typename Function>
A mapped(const A& a, const A& b, const Function& function) {
  A out;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = function(a[i], b[i]);
  return out;
}

// Values on the grid, with room for the samples that fill a register.
constexpr int padded_grid = edge_rows + 2 * both_filters_reach;
using ChannelSamples = Eigen::Matrix<float, edge_rows, 1>;
using SamplesBgr = Eigen::Matrix<float, edge_rows, 3>;
using OnGrid = Eigen::Matrix<float, padded_grid, 3>;

template <std::size_t Size>
SamplesBgr filtered(const std::array<double, Size>& weights, const OnGrid& values) {
  SamplesBgr out = static_cast<float>(weights[0]) * values.middleRows<edge_rows>(both_filters_reach);
  for (int k = 1; k < static_cast<int>(Size); ++k)
    out +=
        static_cast<float>(weights[static_cast<std::size_t>(k)]) *
        (values.middleRows<edge_rows>(both_filters_reach - k) + values.middleRows<edge_rows>(both_filters_reach + k));
  return out;
}

// Values moved along the grid by less than a pixel: the parabola through three of them.
class Shift {
 public:
  explicit Shift(double px) : px_(static_cast<float>(px)) {}

  OnGrid of(const OnGrid& values) const { return px_ == 0 ? values : changed(values, values, -px_, px_ * px_ / 2); }
  // By how much that changes with the shift.
  OnGrid slope(const OnGrid& values) const { return changed(OnGrid::Zero(), values, -1, px_); }

 private:
  static OnGrid changed(OnGrid out, const OnGrid& values, float by_slope, float by_bend) {
    constexpr int inner = edge_grid - 2;
    const auto before = values.middleRows<inner>(0), here = values.middleRows<inner>(1),
               after = values.middleRows<inner>(2);
    out.middleRows<inner>(1) += by_slope / 2 * (after - before) + by_bend * (after - 2 * here + before);
    return out;
  }

  float px_;
};

// Rec. 601's luma of b, g, r. A colour difference is a channel less luma, so a processed channel is
// luma(filtered for luma) + channel(filtered for chroma) - luma(filtered for chroma).
constexpr std::array<float, 3> luma_of{0.114F, 0.587F, 0.299F};

double luma(const Eigen::Vector3d& bgr) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += static_cast<double>(luma_of[static_cast<std::size_t>(c)]) * bgr[c];
  return sum;
}

// Colour differences multiplied, luma as it is; with 1 / saturation the way back.
Eigen::Vector3d saturated_by(double saturation, const Eigen::Vector3d& bgr) {
  const Eigen::Vector3d grey = Eigen::Vector3d::Constant(luma(bgr));
  return grey + saturation * (bgr - grey);
}

// The response both ways, with slopes.
class Encoding {
 public:
  explicit Encoding(const LightTable& light_of_value) : light_(light_of_value) {}

  struct At {
    float y, slope;
  };
  At light(double value) const {
    const float place = 255 * static_cast<float>(std::clamp(value, 0.0, 1.0));
    const std::size_t i = std::min(light_.size() - 2, static_cast<std::size_t>(place));
    const float step = light_[i + 1] - light_[i];
    return {light_[i] + (place - static_cast<float>(i)) * step, 255 * step};
  }
  // `near`: an index to look from, which stays near the last light's.
  At value(float light, std::size_t& near) const {
    while (near < light_.size() - 2 && light_[near + 1] < light) ++near;
    while (near > 0 && light_[near] > light) --near;
    const float step = light_[near + 1] - light_[near];
    const float fraction = std::clamp((light - light_[near]) / step, 0.0F, 1.0F);
    return {(static_cast<float>(near) + fraction) / 255, 1 / (255 * step)};
  }

 private:
  const LightTable& light_;
};

// The encoded light on the grid, a column for each of b, g, r, and its changes.
struct Encoded {
  OnGrid value = OnGrid::Zero(), by_offset = OnGrid::Zero(), by_blur = OnGrid::Zero(), by_before = OnGrid::Zero(),
         by_after = OnGrid::Zero(), by_gradient = OnGrid::Zero();
};

struct EncodedValues {
  OnGrid value = OnGrid::Zero();
};

template <typename What>
What encode(const Encoding& encoding, const PictureProcessing& processing, const EdgeVector& edge) {
  const BlurredEdges& edges = BlurredEdges::instance();
  std::array<BlurredEdge, edge_grid> blurred;
  const auto offset_px = static_cast<float>(edge[edge_offset]), gradient = static_cast<float>(edge[edge_gradient]);
  const Eigen::Vector3d value_before = saturated_by(1 / processing.saturation, edge.segment<3>(edge_before));
  const Eigen::Vector3d value_after = saturated_by(1 / processing.saturation, edge.segment<3>(edge_after));
  What out;
  for (int c = 0; c < 3; ++c) {
    const double blur_px = c == 1 ? processing.blur_px : processing.blur_px * std::exp(processing.log_mosaic);
    const auto inverse_blur = static_cast<float>(1 / blur_px);
    const auto place = [&](int i) { return (static_cast<float>(i - half_grid) - offset_px) * inverse_blur; };
    if (c == 0 || processing.log_mosaic != 0)
      for (int i = 0; i < edge_grid; ++i) blurred[static_cast<std::size_t>(i)] = edges.at(place(i));
    const auto before = encoding.light(value_before[c]), after = encoding.light(value_after[c]);
    const float step = after.y - before.y;
    std::size_t near = static_cast<std::size_t>(255 * std::clamp(value_before[c], 0.0, 0.99));
    for (int i = 0; i < edge_grid; ++i) {
      const BlurredEdge& here = blurred[static_cast<std::size_t>(i)];
      const auto distance_px = static_cast<float>(i - half_grid);
      const float shade = std::max(0.1F, 1 + gradient * distance_px), even = before.y + here.step * step;
      const auto at = encoding.value(shade * even, near);
      out.value(i, c) = at.y;
      if constexpr (std::is_same_v<What, Encoded>) {
        const float moved = -shade * at.slope * step * here.density;
        out.by_offset(i, c) = moved * inverse_blur;
        out.by_blur(i, c) = moved * place(i);
        out.by_before(i, c) = shade * at.slope * (1 - here.step) * before.slope;
        out.by_after(i, c) = shade * at.slope * here.step * after.slope;
        out.by_gradient(i, c) = at.slope * distance_px * even;
      }
    }
  }
  return out;
}

// Filtered samples of all channels from what is filtered for luma and for chroma, a column a channel.
EdgeSamples mixed(const SamplesBgr& for_luma, const SamplesBgr& for_chroma) {
  ChannelSamples common = ChannelSamples::Zero();
  for (int c = 0; c < 3; ++c) common += luma_of[static_cast<std::size_t>(c)] * (for_luma.col(c) - for_chroma.col(c));
  EdgeSamples out;
  for (int c = 0; c < 3; ++c) out.segment<edge_rows>(edge_rows * c) = common + for_chroma.col(c);
  return out;
}

EdgeSamples mixed(const ProcessingFilters& filters, const OnGrid& value, const Shift& chroma) {
  return mixed(filtered(filters.luma, value), filtered(filters.chroma, chroma.of(value)));
}

struct Clipped {
  EdgeSamples value, slope;
};

// Means of values that scatter about these and can't be shown below 0 or above 1.
Clipped clipped(const EdgeSamples& values) {
  constexpr float scatter = 0.02F;  // noise, and how bright the places of a mean are
  const BlurredEdges& edges = BlurredEdges::instance();
  Clipped out;
  for (int i = 0; i < all_edge_rows; ++i) {
    out.value[i] = values[i], out.slope[i] = 1;
    constexpr float far = 5 * scatter;
    if (values[i] > far && values[i] < 1 - far) continue;
    const BlurredEdge low = edges.at(values[i] / scatter), high = edges.at((values[i] - 1) / scatter);
    const float above_black = values[i] * low.step + scatter * low.density;
    const float above_white = (values[i] - 1) * high.step + scatter * high.density;
    out.value[i] = above_black - above_white;
    out.slope[i] = low.step - high.step;
  }
  return out;
}

// By the values shown of one side, and what its being there adds to that by saturation: `by` is by the values before.
template <typename Jacobian>
void add_plateau(const ProcessingFilters& filters, const Shift& shift, const OnGrid& by, double saturation,
                 const Eigen::Vector3d& shown, int first, Jacobian& out) {
  const SamplesBgr none = SamplesBgr::Zero(), for_luma = filtered(filters.luma, by),
                   for_chroma = filtered(filters.chroma, shift.of(by));
  Eigen::Matrix<float, all_edge_rows, 3> by_channel;
  for (int c = 0; c < 3; ++c) {
    SamplesBgr one_luma = none, one_chroma = none;
    one_luma.col(c) = for_luma.col(c), one_chroma.col(c) = for_chroma.col(c);
    by_channel.col(c) = mixed(one_luma, one_chroma);
  }
  const double inverse = 1 / saturation, grey = luma(shown);
  const EdgeSamples by_grey = by_channel.col(0) + by_channel.col(1) + by_channel.col(2);
  for (int c = 0; c < 3; ++c) {
    out.col(static_cast<int>(ProcessingUnknown::saturation)) -=
        static_cast<float>((shown[c] - grey) * inverse * inverse) * by_channel.col(c);
    out.col(first + c) = static_cast<float>(inverse) * by_channel.col(c) +
                         static_cast<float>(1 - inverse) * luma_of[static_cast<std::size_t>(c)] * by_grey;
  }
}

}  // namespace

PictureProcessing processing_of(const ProcessingVector& unknowns) {
  const auto at = [&](ProcessingUnknown unknown) { return unknowns[static_cast<int>(unknown)]; };
  using enum ProcessingUnknown;
  return {.blur_px = std::exp(at(log_blur)),
          .log_mosaic = at(log_mosaic),
          .chroma_variance_px2 = at(chroma_variance),
          .saturation = at(saturation),
          .sharpening = at(sharpening),
          .sharpening_px = std::exp(at(log_radius)),
          .chroma_shift_px = at(chroma_shift_px)};
}

EdgeVector edge_of(const PictureProcessing& processing, const Eigen::Vector3d& before, const Eigen::Vector3d& after,
                   double offset_px) {
  EdgeVector edge;
  edge << offset_px, saturated_by(processing.saturation, before), saturated_by(processing.saturation, after), 0;
  return edge;
}

ProcessingFilters::ProcessingFilters(const PictureProcessing& p, bool derivatives) {
  constexpr double step = 1e-2;
  const Filter none{1, 0, 0, 0, 0}, mask = gaussian(p.sharpening_px), blur = chroma_blur(p.chroma_variance_px2);
  const Filter by_amount = mapped(none, mask, [](double a, double b) { return a - b; });
  const Filter sharpened = mapped(none, by_amount, [&](double a, double b) { return a + p.sharpening * b; });
  luma = sharpened;
  chroma = convolved(sharpened, blur, p.saturation);
  if (!derivatives) return;
  const Filter wider = gaussian(p.sharpening_px * (1 + step));
  const Filter by_radius = mapped(mask, wider, [&](double a, double b) { return p.sharpening * (a - b) / step; });
  const Filter blurrier = chroma_blur(p.chroma_variance_px2 + step);
  const Filter by_variance = mapped(blur, blurrier, [&](double a, double b) { return (b - a) / step; });
  luma_by_sharpening = by_amount;
  chroma_by_sharpening = convolved(by_amount, blur, p.saturation);
  luma_by_radius = by_radius;
  chroma_by_radius = convolved(by_radius, blur, p.saturation);
  chroma_by_variance = convolved(sharpened, by_variance, p.saturation);
}

EdgeSamples ProcessedEdge::values(const ProcessingFilters& filters, const PictureProcessing& processing,
                                  const EdgeVector& edge) const {
  const auto encoded = encode<EncodedValues>(Encoding(light_of_value_), processing, edge);
  return clipped(mixed(filters, encoded.value, Shift(processing.chroma_shift_px))).value;
}

ProcessedEdge::Linearised ProcessedEdge::linearised(const ProcessingFilters& filters,
                                                    const PictureProcessing& processing, const EdgeVector& edge) const {
  const auto encoded = encode<Encoded>(Encoding(light_of_value_), processing, edge);
  const Shift shift(processing.chroma_shift_px);
  const OnGrid value_of_chroma = shift.of(encoded.value);
  const SamplesBgr none = SamplesBgr::Zero(), chroma = filtered(filters.chroma, value_of_chroma);
  OnGrid by_mosaic = encoded.by_blur;
  by_mosaic.col(1).setZero();
  Linearised out;
  const auto column = [&](ProcessingUnknown unknown) { return out.jacobian.col(static_cast<int>(unknown)); };
  using enum ProcessingUnknown;
  column(log_blur) = mixed(filters, encoded.by_blur, shift);
  column(log_mosaic) = mixed(filters, by_mosaic, shift);
  column(chroma_variance) = mixed(none, filtered(filters.chroma_by_variance, value_of_chroma));
  column(saturation) = mixed(none, chroma / static_cast<float>(processing.saturation));
  column(sharpening) = mixed(filtered(filters.luma_by_sharpening, encoded.value),
                             filtered(filters.chroma_by_sharpening, value_of_chroma));
  column(log_radius) =
      mixed(filtered(filters.luma_by_radius, encoded.value), filtered(filters.chroma_by_radius, value_of_chroma));
  column(chroma_shift_px) = mixed(none, filtered(filters.chroma, shift.slope(encoded.value)));
  out.jacobian.col(processing_unknowns + edge_offset) = mixed(filters, encoded.by_offset, shift);
  out.jacobian.col(processing_unknowns + edge_gradient) = mixed(filters, encoded.by_gradient, shift);
  add_plateau(filters, shift, encoded.by_before, processing.saturation, edge.segment<3>(edge_before),
              processing_unknowns + edge_before, out.jacobian);
  add_plateau(filters, shift, encoded.by_after, processing.saturation, edge.segment<3>(edge_after),
              processing_unknowns + edge_after, out.jacobian);
  const Clipped shown = clipped(mixed(filtered(filters.luma, encoded.value), chroma));
  out.values = shown.value;
  for (auto by_unknown : out.jacobian.colwise()) by_unknown = by_unknown.cwiseProduct(shown.slope).eval();
  return out;
}

FilteredLight filtered_light(const LightTable& light_of_value, const PictureProcessing& processing,
                             std::span<const std::array<double, 3>> light) {
  PictureProcessing unsaturated = processing;
  unsaturated.saturation = 1;
  const ProcessingFilters filters(unsaturated, false);
  const Encoding encoding(light_of_value);
  std::vector<std::array<double, 3>> differences(light.size());  // to luma
  FilteredLight out{std::vector<std::array<double, 3>>(light.size()), std::vector<double>(light.size())};
  std::vector<double> luma(light.size());
  std::size_t near = 128;
  for (std::size_t i = 0; i < light.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      differences[i][c] = static_cast<double>(encoding.value(static_cast<float>(light[i][c]), near).y);
      luma[i] += static_cast<double>(luma_of[c]) * differences[i][c];
    }
    for (double& difference : differences[i]) difference -= luma[i];
  }
  const auto last = static_cast<std::ptrdiff_t>(light.size()) - 1;
  for (std::ptrdiff_t i = 0; i <= last; ++i) {
    std::array<double, 3> value{};
    double grey = 0;
    for (std::ptrdiff_t k = -both_filters_reach; k <= both_filters_reach; ++k) {
      const auto at = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i + k, 0, last));
      const auto tap = static_cast<std::size_t>(std::abs(k));
      if (tap <= filter_reach) grey += filters.luma[tap] * luma[at];
      for (std::size_t c = 0; c < 3; ++c) value[c] += filters.chroma[tap] * differences[at][c];
    }
    const auto place = static_cast<std::size_t>(i);
    for (std::size_t c = 0; c < 3; ++c) out.light[place][c] = static_cast<double>(encoding.light(grey + value[c]).y);
    out.luma[place] = static_cast<double>(encoding.light(grey).y);
  }
  return out;
}

}  // namespace lapservo::internal
