#include "lapservo/vision/survey/side_biases.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <Eigen/Cholesky>

#include "lapservo/core/statistics.h"
#include "lapservo/vision/edges/blurred_edges.h"
#include "lapservo/vision/edges/edge_lines.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t min_lines_of_side = 4;
constexpr int filters_reach_px = 8;  // beyond the samples, so that what is filtered there has neighbours
constexpr int contour_iterations = 6, rounds_of_colours = 4;

constexpr int contour_colours = 3;  // around, the contour's step, the shading inside
using ContourBasis = Eigen::Matrix<double, Eigen::Dynamic, contour_colours>;
using ContourColours = Eigen::Matrix<double, contour_colours, 3>;

// fit_contour's model: a row a pixel from `first_px` on.
ContourBasis contour_model(int first_px, int count, double contour_px, double blur_px, double radius_px) {
  const BlurredEdges& edges = BlurredEdges::instance();
  ContourBasis basis(count, contour_colours);
  for (int i = 0; i < count; ++i) {
    const BlurredEdge edge = edges.at(static_cast<float>((first_px + i - contour_px) / blur_px));
    const auto root = static_cast<double>(edge.root), three_halves = static_cast<double>(edge.three_halves);
    basis.row(i) << 1, static_cast<double>(edge.step),
        std::sqrt(2 / radius_px * blur_px) * (root - blur_px * three_halves / (4 * radius_px));
  }
  return basis;
}

// What the profile's light is made of. Nullopt where much of it is saturated.
std::optional<ContourColours> colours_of(const EdgeProfile& profile, double contour_px, double blur_px,
                                         double radius_px) {
  const auto count = static_cast<int>(profile.count);
  const ContourBasis basis = contour_model(static_cast<int>(profile.first_px), count, contour_px, blur_px, radius_px);
  ContourColours colours;
  for (int c = 0; c < 3; ++c) {
    const auto channel = static_cast<std::size_t>(c);
    Eigen::Matrix3d normal = 1e-6 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    int used = 0;
    for (int i = 0; i < count; ++i) {
      const auto sample = static_cast<std::size_t>(i);
      if (!profile.usable[channel][sample]) continue;
      normal += basis.row(i).transpose() * basis.row(i);
      gradient += static_cast<double>(profile.light[channel][sample]) * basis.row(i).transpose();
      ++used;
    }
    if (2 * used < count) return std::nullopt;
    colours.col(c) = normal.ldlt().solve(gradient);
  }
  return colours;
}

// The profile that the processing makes of a contour of these colours at 0.
EdgeProfile processed_profile(const EdgeProfile& like, const ContourColours& colours, const LightImage& light,
                              const PictureProcessing& processing, double blur_px, double radius_px) {
  const int first_px = static_cast<int>(like.first_px) - filters_reach_px;
  const int count = static_cast<int>(like.count) + 2 * filters_reach_px;
  const Eigen::Matrix<double, Eigen::Dynamic, 3> true_light =
      contour_model(first_px, count, 0, blur_px, radius_px) * colours;
  std::vector<std::array<double, 3>> samples(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i)
    for (int c = 0; c < 3; ++c)
      samples[static_cast<std::size_t>(i)][static_cast<std::size_t>(c)] = std::max(0.0, true_light(i, c));
  const auto filtered = filtered_light(light.light_of_value(), processing, samples).light;
  EdgeProfile profile = like;
  for (std::size_t c = 0; c < 3; ++c) {
    profile.usable[c].fill(true);
    for (std::size_t i = 0; i < like.count; ++i)
      profile.light[c][i] = static_cast<float>(filtered[i + filters_reach_px][c]);
  }
  return profile;
}

// The light's own blur at the sides, as lines show it: motion may widen it there, the processing widens it as it does
// at boundaries. Lines are sampled linearly between pixels, which blurs by 1/6 px^2 on average; the processing's blur
// of light is without that.
double light_blur_px(const EdgeBlur& blur, const PictureProcessing& processing) {
  constexpr double linear_sampling_px2 = 1.0 / 6;
  const double by_processing_px2 =
      blur.boundaries_px() * blur.boundaries_px() - processing.blur_px * processing.blur_px - linear_sampling_px2;
  return std::sqrt(
      std::max(blur_limits.min_blur_px * blur_limits.min_blur_px, blur.sides_px * blur.sides_px - by_processing_px2));
}

std::optional<double> bias_on_line(const LightImage& light, const Measurement& m, const PictureProcessing& processing,
                                   const EdgeBlur& blur, double radius_px) {
  constexpr double extra_px = 3;
  EdgeLine line;
  const Eigen::Vector2f at_px = m.expected_px + static_cast<float>(m.residual_px) * m.normal;
  line.u_px = at_px.x(), line.v_px = at_px.y(), line.du = m.normal.x(), line.dv = m.normal.y();
  line.before = outside_of_side_px(blur.sides_px, extra_px);
  line.after = inside_of_side_px(radius_px);
  const auto contains = [&](int t) {
    return light.contains((at_px + static_cast<float>(t) * m.normal).cast<double>());
  };
  if (!contains(-line.before) || !contains(line.after)) return std::nullopt;
  const EdgeProfile seen = sample_profile(light, line);
  const auto seen_colours = colours_of(seen, 0, blur.sides_px, radius_px);
  if (!seen_colours) return std::nullopt;
  // Those that the processing makes these of.
  ContourColours colours = *seen_colours;
  double bias_px = 0;
  for (int round = 0; round < rounds_of_colours; ++round) {
    const EdgeProfile made =
        processed_profile(seen, colours, light, processing, light_blur_px(blur, processing), radius_px);
    const EdgeFit fit =
        fit_contour(made, static_cast<float>(blur.sides_px), static_cast<float>(radius_px), contour_iterations);
    if (!fit.converged) return std::nullopt;
    bias_px = static_cast<double>(fit.offset_px);
    colours += *seen_colours - colours_of(made, bias_px, blur.sides_px, radius_px).value();
  }
  return bias_px;
}

}  // namespace

std::array<std::optional<double>, 2> side_biases_px(const LightImage& light, std::span<const Measurement> measurements,
                                                    const PictureProcessing& processing, const EdgeBlur& blur,
                                                    double radius_px) {
  std::array<std::vector<double>, 2> told_px;
  for (const Measurement& m : measurements)
    if (m.group >= 4)
      if (const auto bias_px = bias_on_line(light, m, processing, blur, radius_px))
        told_px[m.group - 4].push_back(*bias_px);
  std::array<std::optional<double>, 2> biases_px;
  for (std::size_t side = 0; side < 2; ++side)
    if (told_px[side].size() >= min_lines_of_side) biases_px[side] = median(told_px[side]);
  return biases_px;
}

}  // namespace lapservo::internal
