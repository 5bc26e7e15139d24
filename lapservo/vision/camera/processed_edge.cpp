#include "lapservo/vision/camera/processed_edge.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "lapservo/vision/edges/blurred_edges.h"

namespace lapservo::internal {
namespace {

constexpr int edge_grid = PooledEdge::samples + 2 * both_filters_reach, half_grid = edge_grid / 2;

Filter gaussian(double sigma_px) {
  Filter filter;
  double sum = 0;
  for (int i = 0; i <= filter_reach; ++i) {
    const double x = i / sigma_px;
    filter[i] = std::exp(-x * x / 2);
    sum += i == 0 ? filter[i] : 2 * filter[i];
  }
  return filter / sum;
}

const Filter no_filter{1., 0., 0., 0., 0.};

// Four passes over neighbours: linear in the variance near none.
Filter chroma_blur(double variance_px2) {
  const double side = variance_px2 / 8;
  Filter filter = no_filter;
  for (int pass = 0; pass < filter_reach; ++pass) {
    const Filter before = filter;
    for (int i = 0; i <= filter_reach; ++i) {
      const double inner = before[std::abs(i - 1)], outer = i < filter_reach ? before[i + 1] : 0;
      filter[i] = (1 - 2 * side) * before[i] + side * (inner + outer);
    }
  }
  return filter;
}

BothFilters convolved(const Filter& a, const Filter& b, double factor) {
  BothFilters both = BothFilters::Zero();
  const auto tap = [](const Filter& filter, int i) { return std::abs(i) <= filter_reach ? filter[std::abs(i)] : 0; };
  for (int i = 0; i <= both_filters_reach; ++i)
    for (int k = -filter_reach; k <= filter_reach; ++k) both[i] += tap(a, k) * tap(b, i - k);
  return both * factor;
}

// Values on the grid, with room for the samples that fill a register.
constexpr int padded_grid = edge_rows + 2 * both_filters_reach;
using ChannelSamples = Eigen::Matrix<float, edge_rows, 1>;
using SamplesBgr = Eigen::Matrix<float, edge_rows, 3>;
using OnGrid = Eigen::Matrix<float, padded_grid, 3>;

template <typename Taps>
SamplesBgr filtered(const Taps& weights, const OnGrid& values) {
  SamplesBgr out = static_cast<float>(weights[0]) * values.middleRows<edge_rows>(both_filters_reach);
  for (int k = 1; k < weights.size(); ++k)
    out += static_cast<float>(weights[k]) * (values.middleRows<edge_rows>(both_filters_reach - k) +
                                             values.middleRows<edge_rows>(both_filters_reach + k));
  return out;
}

// `out`, and what the slope and the bend of values on the grid, of the parabola through three of them, add to it.
OnGrid changed(OnGrid out, const OnGrid& values, float by_slope, float by_bend) {
  constexpr int inner = edge_grid - 2;
  const auto before = values.middleRows<inner>(0), here = values.middleRows<inner>(1),
             after = values.middleRows<inner>(2);
  out.middleRows<inner>(1) += by_slope / 2 * (after - before) + by_bend * (after - 2 * here + before);
  return out;
}

// Values moved along the grid by less than a pixel.
OnGrid shifted(const OnGrid& values, double shift_px) {
  const auto px = static_cast<float>(shift_px);
  return px == 0 ? values : changed(values, values, -px, px * px / 2);
}

// Rec. 601's luma of b, g, r. A colour difference is a channel less luma, so a processed channel is
// luma(filtered for luma) + channel(filtered for chroma) - luma(filtered for chroma).
constexpr float luma_of_blue = 0.114F, luma_of_red = 0.299F;
constexpr std::array<float, 3> luma_of{luma_of_blue, 1 - luma_of_blue - luma_of_red, luma_of_red};

double luma(const Eigen::Vector3d& bgr) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += static_cast<double>(luma_of[static_cast<std::size_t>(c)]) * bgr[c];
  return sum;
}

// Colour differences multiplied, luma as it is.
Eigen::Vector3d saturated_by(double saturation, const Eigen::Vector3d& bgr) {
  const Eigen::Vector3d grey = Eigen::Vector3d::Constant(luma(bgr));
  return grey + saturation * (bgr - grey);
}

// `near`: an index to look from, which stays near the last light's. Where neighbouring values share a light, to within
// what has an inverse, it is one of them, with a slope of 0.
Encoding value_at(const LightTable& table, float light, std::size_t& near) {
  while (near < table.size() - 2 && table[near + 1] < light) ++near;
  while (near > 0 && table[near] > light) --near;
  const float step = table[near + 1] - table[near];
  if (step < std::numeric_limits<float>::min()) return {static_cast<float>(near) / 255, 0};
  const float fraction = std::clamp((light - table[near]) / step, 0.0F, 1.0F);
  return {(static_cast<float>(near) + fraction) / 255, 1 / (255 * step)};
}

// The encoded light on the grid, a column for each of b, g, r, and with `derivatives` its changes.
struct Encoded {
  OnGrid value = OnGrid::Zero(), by_offset = OnGrid::Zero(), by_blur = OnGrid::Zero(), by_before = OnGrid::Zero(),
         by_after = OnGrid::Zero(), by_gradient = OnGrid::Zero();
};

Encoded encode(const LightTable& light_of_value, const PictureProcessing& processing, const EdgeVector& edge,
               bool derivatives) {
  const BlurredEdges& edges = BlurredEdges::instance();
  std::array<BlurredEdge, edge_grid> blurred;
  const auto offset_px = static_cast<float>(edge[edge_offset]), gradient = static_cast<float>(edge[edge_gradient]);
  const Eigen::Vector3d value_before = saturated_by(1 / processing.saturation, edge.segment<3>(edge_before));
  const Eigen::Vector3d value_after = saturated_by(1 / processing.saturation, edge.segment<3>(edge_after));
  Encoded out;
  for (int c = 0; c < 3; ++c) {
    const double blur_px = c == 1 ? processing.blur_px : processing.blur_px * std::exp(processing.log_mosaic);
    const auto inverse_blur = static_cast<float>(1 / blur_px);
    const auto place = [&](int i) { return (static_cast<float>(i - half_grid) - offset_px) * inverse_blur; };
    if (c == 0 || processing.log_mosaic != 0)
      for (int i = 0; i < edge_grid; ++i) blurred[static_cast<std::size_t>(i)] = edges.at(place(i));
    const Encoding before = light_at(light_of_value, value_before[c]), after = light_at(light_of_value, value_after[c]);
    const float step = after.y - before.y;
    auto near = std::min<std::size_t>(LightImage::saturated_value,
                                      static_cast<std::size_t>(255 * std::clamp(value_before[c], 0.0, 1.0)));
    for (int i = 0; i < edge_grid; ++i) {
      const BlurredEdge& here = blurred[static_cast<std::size_t>(i)];
      const auto distance_px = static_cast<float>(i - half_grid);
      const float shade = std::max(0.0F, 1 + gradient * distance_px), even = before.y + here.step * step;
      const Encoding at = value_at(light_of_value, shade * even, near);
      out.value(i, c) = at.y;
      if (!derivatives) continue;
      const float moved = -shade * at.slope * step * here.density;
      out.by_offset(i, c) = moved * inverse_blur;
      out.by_blur(i, c) = moved * place(i);
      out.by_before(i, c) = shade * at.slope * (1 - here.step) * before.slope;
      out.by_after(i, c) = shade * at.slope * here.step * after.slope;
      out.by_gradient(i, c) = at.slope * distance_px * even;
    }
  }
  return out;
}

// Filtered samples of all channels from what is filtered for luma and for chroma, a column a channel.
EdgeSamples mixed(const SamplesBgr& for_luma, const SamplesBgr& for_chroma) {
  ChannelSamples common = ChannelSamples::Zero();
  for (int c = 0; c < 3; ++c) common += luma_of[static_cast<std::size_t>(c)] * (for_luma.col(c) - for_chroma.col(c));
  return SamplesBgr(for_chroma.colwise() + common).reshaped();
}

EdgeSamples mixed(const ProcessingFilters& filters, const OnGrid& value) {
  return mixed(filtered(filters.luma, value),
               filtered(filters.chroma, shifted(value, filters.processing.chroma_shift_px)));
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
void add_plateau(const ProcessingFilters& filters, const OnGrid& by, const Eigen::Vector3d& shown, int first,
                 decltype(LinearisedEdge::jacobian)& out) {
  const SamplesBgr none = SamplesBgr::Zero(), for_luma = filtered(filters.luma, by),
                   for_chroma = filtered(filters.chroma, shifted(by, filters.processing.chroma_shift_px));
  Eigen::Matrix<float, all_edge_rows, 3> by_channel;
  for (int c = 0; c < 3; ++c) {
    SamplesBgr one_luma = none, one_chroma = none;
    one_luma.col(c) = for_luma.col(c), one_chroma.col(c) = for_chroma.col(c);
    by_channel.col(c) = mixed(one_luma, one_chroma);
  }
  const double inverse = 1 / filters.processing.saturation, grey = luma(shown);
  const EdgeSamples by_grey = by_channel.col(0) + by_channel.col(1) + by_channel.col(2);
  for (int c = 0; c < 3; ++c) {
    out.col(ProcessingUnknown::saturation) -=
        static_cast<float>((shown[c] - grey) * inverse * inverse) * by_channel.col(c);
    out.col(first + c) = static_cast<float>(inverse) * by_channel.col(c) +
                         static_cast<float>(1 - inverse) * luma_of[static_cast<std::size_t>(c)] * by_grey;
  }
}

}  // namespace

Encoding light_at(const LightTable& table, double value) {
  const float place = 255 * static_cast<float>(std::clamp(value, 0.0, 1.0));
  const std::size_t i = std::min(table.size() - 2, static_cast<std::size_t>(place));
  const float step = table[i + 1] - table[i];
  return {table[i] + (place - static_cast<float>(i)) * step, 255 * step};
}

PictureProcessing processing_of(const ProcessingVector& unknowns) {
  using enum ProcessingUnknown::Index;
  return {.blur_px = std::exp(unknowns[log_blur]),
          .log_mosaic = unknowns[log_mosaic],
          .chroma_variance_px2 = unknowns[chroma_variance],
          .saturation = unknowns[saturation],
          .sharpening = unknowns[sharpening],
          .sharpening_px = std::exp(unknowns[log_radius]),
          .chroma_shift_px = unknowns[chroma_shift_px]};
}

ProcessingFilters::ProcessingFilters(const PictureProcessing& p, bool derivatives) : processing(p) {
  constexpr double step = 1e-2;
  const Filter mask = gaussian(p.sharpening_px), blur = chroma_blur(p.chroma_variance_px2);
  luma_by_sharpening = no_filter - mask;
  luma = no_filter + p.sharpening * luma_by_sharpening;
  chroma = convolved(luma, blur, p.saturation);
  if (!derivatives) return;
  luma_by_radius = p.sharpening * (mask - gaussian(p.sharpening_px * (1 + step))) / step;
  const Filter blur_by_variance = (chroma_blur(p.chroma_variance_px2 + step) - blur) / step;
  chroma_by_sharpening = convolved(luma_by_sharpening, blur, p.saturation);
  chroma_by_radius = convolved(luma_by_radius, blur, p.saturation);
  chroma_by_variance = convolved(luma, blur_by_variance, p.saturation);
}

EdgeSamples processed_edge(const LightTable& light_of_value, const ProcessingFilters& filters, const EdgeVector& edge) {
  return clipped(mixed(filters, encode(light_of_value, filters.processing, edge, false).value)).value;
}

LinearisedEdge linearised_edge(const LightTable& light_of_value, const ProcessingFilters& filters,
                               const EdgeVector& edge) {
  const Encoded encoded = encode(light_of_value, filters.processing, edge, true);
  const double shift_px = filters.processing.chroma_shift_px;
  const OnGrid value_of_chroma = shifted(encoded.value, shift_px);
  const SamplesBgr none = SamplesBgr::Zero(), chroma = filtered(filters.chroma, value_of_chroma);
  OnGrid by_mosaic = encoded.by_blur;
  by_mosaic.col(1).setZero();
  LinearisedEdge out;
  const auto column = [&](int unknown) { return out.jacobian.col(unknown); };
  using enum ProcessingUnknown::Index;
  column(log_blur) = mixed(filters, encoded.by_blur);
  column(log_mosaic) = mixed(filters, by_mosaic);
  column(chroma_variance) = mixed(none, filtered(filters.chroma_by_variance, value_of_chroma));
  column(saturation) = mixed(none, chroma / static_cast<float>(filters.processing.saturation));
  column(sharpening) = mixed(filtered(filters.luma_by_sharpening, encoded.value),
                             filtered(filters.chroma_by_sharpening, value_of_chroma));
  column(log_radius) =
      mixed(filtered(filters.luma_by_radius, encoded.value), filtered(filters.chroma_by_radius, value_of_chroma));
  column(chroma_shift_px) =
      mixed(none, filtered(filters.chroma, changed(OnGrid::Zero(), encoded.value, -1, static_cast<float>(shift_px))));
  column(processing_unknowns + edge_offset) = mixed(filters, encoded.by_offset);
  column(processing_unknowns + edge_gradient) = mixed(filters, encoded.by_gradient);
  add_plateau(filters, encoded.by_before, edge.segment<3>(edge_before), processing_unknowns + edge_before,
              out.jacobian);
  add_plateau(filters, encoded.by_after, edge.segment<3>(edge_after), processing_unknowns + edge_after, out.jacobian);
  const Clipped shown = clipped(mixed(filtered(filters.luma, encoded.value), chroma));
  out.values = shown.value;
  for (auto by_unknown : out.jacobian.colwise()) by_unknown = by_unknown.cwiseProduct(shown.slope).eval();
  return out;
}

std::vector<std::array<double, 3>> filtered_light(const LightTable& light_of_value, const PictureProcessing& processing,
                                                  std::span<const std::array<double, 3>> light, bool as_grey) {
  PictureProcessing unsaturated = processing;
  unsaturated.saturation = 1;
  const ProcessingFilters filters(unsaturated, false);
  std::vector<Eigen::Vector3d> differences(light.size());  // to luma
  std::vector<std::array<double, 3>> out(light.size());
  std::vector<double> lumas;
  std::size_t near = light_of_value.size() - 2;
  for (std::size_t i = 0; i < light.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      differences[i][static_cast<int>(c)] =
          static_cast<double>(value_at(light_of_value, static_cast<float>(light[i][c]), near).y);
    lumas.push_back(luma(differences[i]));
    differences[i].array() -= lumas[i];
  }
  const auto last = static_cast<std::ptrdiff_t>(light.size()) - 1;
  for (std::ptrdiff_t i = 0; i <= last; ++i) {
    Eigen::Vector3d value = Eigen::Vector3d::Zero();
    double grey = 0;
    for (std::ptrdiff_t k = -both_filters_reach; k <= both_filters_reach; ++k) {
      const auto at = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i + k, 0, last));
      const auto tap = std::abs(k);
      if (tap <= filter_reach) grey += filters.luma[tap] * lumas[at];
      if (!as_grey) value += filters.chroma[tap] * differences[at];
    }
    for (int c = 0; c < 3; ++c)
      out[static_cast<std::size_t>(i)][static_cast<std::size_t>(c)] =
          static_cast<double>(light_at(light_of_value, grey + value[c]).y);
  }
  return out;
}

}  // namespace lapservo::internal
