#include "lapservo/vision/edges/edge_profile.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

#include "lapservo/vision/edges/blurred_edges.h"

namespace lapservo::internal {
namespace {

// At every sample: the model's linear basis (a constant, then `Shapes`), and the shapes' derivatives by the edge's
// position and by the blur.
template <int Shapes>
struct Basis {
  std::array<std::array<float, EdgeProfile::max_samples>, Shapes> value, by_position, by_blur;
};

// One shape: a step. The second one: sqrt(1 - (1 - d/R)^2) = sqrt(2 d / R) (1 - d / 4R - ...), the occluding contour
// within a third of the radius.
template <int Shapes>
Basis<Shapes> basis_at(const EdgeProfile& profile, float edge_px, float blur_px, float radius_px) {
  Basis<Shapes> basis;
  const BlurredEdges& edges = BlurredEdges::instance();
  const float scale = std::sqrt(2 / radius_px), root_blur = std::sqrt(blur_px);
  for (std::size_t i = 0; i < profile.count; ++i) {
    const float u = (profile.first_px + static_cast<float>(i) - edge_px) / blur_px;
    const BlurredEdge edge = edges.at(u);
    basis.value[0][i] = edge.step;
    basis.by_position[0][i] = -edge.density / blur_px;
    basis.by_blur[0][i] = -edge.density * u / blur_px;
    if constexpr (Shapes == 2) {
      basis.value[1][i] = scale * root_blur * (edge.root - blur_px * edge.three_halves / (4 * radius_px));
      basis.by_position[1][i] =
          -scale / root_blur * (edge.root_slope - blur_px * (3.0F / 2) * edge.root / (4 * radius_px));
      basis.by_blur[1][i] = scale / root_blur * (0.5F * edge.root - u * edge.root_slope);
    }
  }
  return basis;
}

template <int Shapes>
using Amplitudes = Eigen::Matrix<float, Shapes + 1, 1>;  // of a constant and the shapes

template <int Shapes>
Amplitudes<Shapes> row_of(const Basis<Shapes>& basis, std::size_t sample) {
  Amplitudes<Shapes> row;
  row[0] = 1;
  for (int s = 0; s < Shapes; ++s) row[s + 1] = basis.value[static_cast<std::size_t>(s)][sample];
  return row;
}

// The amplitudes that fit one channel best.
template <int Shapes>
struct ChannelFit {
  Eigen::LDLT<Eigen::Matrix<float, Shapes + 1, Shapes + 1>> solver;
  Amplitudes<Shapes> amplitude;
  int used = 0;  // samples
};

// Nullopt where the channel has too few samples.
template <int Shapes>
std::optional<ChannelFit<Shapes>> fit_channel(const EdgeProfile& profile, const Basis<Shapes>& basis, std::size_t c) {
  constexpr int more_than_unknowns = 4;
  Eigen::Matrix<float, Shapes + 1, Shapes + 1> normal;
  normal.setZero();
  Amplitudes<Shapes> light_sum = Amplitudes<Shapes>::Zero();
  ChannelFit<Shapes> channel;
  for (std::size_t i = 0; i < profile.count; ++i) {
    if (!profile.usable[c][i]) continue;
    const Amplitudes<Shapes> row = row_of(basis, i);
    normal.noalias() += row * row.transpose();
    light_sum.noalias() += profile.light[c][i] * row;
    ++channel.used;
  }
  if (channel.used < Shapes + 1 + more_than_unknowns) return std::nullopt;
  normal.diagonal().array() += 1e-5F;
  channel.solver.compute(normal);
  channel.amplitude = channel.solver.solve(light_sum);
  return channel;
}

// Sums over the channels, of what their amplitudes can't imitate.
struct PositionSums {
  float position_gradient = 0, position_and_blur = 0, squares = 0;
  int degrees = -1;
};

template <int Shapes>
void add_channel(const EdgeProfile& profile, const Basis<Shapes>& basis, std::size_t c,
                 const ChannelFit<Shapes>& channel, EdgeFit& fit, PositionSums& sums) {
  // Derivatives of the model.
  std::array<float, EdgeProfile::max_samples> position, blur, miss;
  Amplitudes<Shapes> position_sum = Amplitudes<Shapes>::Zero(), blur_sum = Amplitudes<Shapes>::Zero();
  for (std::size_t i = 0; i < profile.count; ++i) {
    if (!profile.usable[c][i]) continue;
    const Amplitudes<Shapes> row = row_of(basis, i);
    position[i] = blur[i] = 0;
    for (int s = 0; s < Shapes; ++s) {
      position[i] += channel.amplitude[s + 1] * basis.by_position[static_cast<std::size_t>(s)][i];
      blur[i] += channel.amplitude[s + 1] * basis.by_blur[static_cast<std::size_t>(s)][i];
    }
    miss[i] = profile.light[c][i] - channel.amplitude.dot(row);
    position_sum += position[i] * row;
    blur_sum += blur[i] * row;
  }
  const Amplitudes<Shapes> position_part = channel.solver.solve(position_sum),
                           blur_part = channel.solver.solve(blur_sum);
  for (std::size_t i = 0; i < profile.count; ++i) {
    if (!profile.usable[c][i]) continue;
    const Amplitudes<Shapes> row = row_of(basis, i);
    const float p = position[i] - position_part.dot(row), b = blur[i] - blur_part.dot(row);
    sums.position_gradient += p * miss[i];
    fit.information += p * p;
    fit.blur_gradient += b * miss[i];
    fit.blur_information += b * b;
    sums.position_and_blur += p * b;
    sums.squares += miss[i] * miss[i];
  }
  sums.degrees += channel.used - (Shapes + 1);
  fit.step[c] = channel.amplitude.template tail<Shapes>().sum();
  fit.before[c] = channel.amplitude[0];
}

// One variable-projection step: linear amplitudes per channel, then the position in what they leave.
template <int Shapes>
EdgeFit project(const EdgeProfile& profile, const Basis<Shapes>& basis) {
  EdgeFit fit;
  PositionSums sums;
  for (std::size_t c = 0; c < 3; ++c)
    if (const auto channel = fit_channel(profile, basis, c)) add_channel(profile, basis, c, *channel, fit, sums);
  if (sums.degrees < 3 || !(fit.information > min_edge_information)) return fit;
  fit.offset_px = sums.position_gradient / fit.information;
  // For the blur, whatever the position is.
  fit.blur_gradient -= fit.offset_px * sums.position_and_blur;
  fit.blur_information -= sums.position_and_blur * sums.position_and_blur / fit.information;
  fit.residual_variance = sums.squares / static_cast<float>(sums.degrees);
  fit.converged = std::isfinite(fit.offset_px) && std::isfinite(fit.residual_variance);
  return fit;
}

template <int Shapes>
EdgeFit iterate(const EdgeProfile& profile, float blur_px, float radius_px, int iterations) {
  float edge_px = 0;
  EdgeFit fit;
  const float reach_px = static_cast<float>(profile.count) / 2;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    fit = project(profile, basis_at<Shapes>(profile, edge_px, blur_px, radius_px));
    if (!fit.converged) return fit;
    const float step_px = std::clamp(fit.offset_px, -2.0F, 2.0F);
    edge_px += step_px;
    fit.converged = std::abs(edge_px) <= reach_px;
    if (!fit.converged) return fit;
    if (std::abs(step_px) < edge_tolerance_px) break;
  }
  fit.converged = std::abs(fit.offset_px) < (iterations > 1 ? max_last_step_px : max_only_step_px);
  fit.offset_px = edge_px;
  return fit;
}

}  // namespace

EdgeFit fit_step(const EdgeProfile& profile, float blur_px, int iterations) {
  return iterate<1>(profile, blur_px, 1, iterations);
}

EdgeFit fit_contour(const EdgeProfile& profile, float blur_px, float radius_px, int iterations) {
  return iterate<2>(profile, blur_px, radius_px, iterations);
}

}  // namespace lapservo::internal
