#include "lapservo/vision/edges/edge_profile.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/edges/blurred_edges.h"

namespace lapservo::internal {
namespace {

// At every sample: the model's linear basis, a constant and then `Shapes`; and the shapes' derivatives.
template <int Shapes>
struct Basis {
  using Amplitudes = Eigen::Matrix<float, Shapes + 1, 1>;
  std::array<Amplitudes, EdgeProfile::max_samples> row;
  std::array<Eigen::Matrix<float, Shapes, 1>, EdgeProfile::max_samples> by_position, by_blur;
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
    basis.row[i][0] = 1;
    basis.row[i][1] = edge.step;
    basis.by_position[i][0] = -edge.density / blur_px;
    basis.by_blur[i][0] = -edge.density * u / blur_px;
    if constexpr (Shapes == 2) {
      basis.row[i][2] = scale * root_blur * (edge.root - blur_px * edge.three_halves / (4 * radius_px));
      basis.by_position[i][1] =
          -scale / root_blur * (edge.root_slope - blur_px * (3.0F / 2) * edge.root / (4 * radius_px));
      basis.by_blur[i][1] = scale / root_blur * (0.5F * edge.root - u * edge.root_slope);
    }
  }
  return basis;
}

// Sums over the channels, of what their amplitudes can't imitate.
struct PositionSums {
  float position_gradient = 0, position_and_blur = 0, squares = 0;
  int degrees = -1;
};

// With the amplitudes that fit the channel best; nothing where it has too few samples.
template <int Shapes>
void add_channel(const EdgeProfile& profile, const Basis<Shapes>& basis, std::size_t c, EdgeFit& fit,
                 PositionSums& sums) {
  using Amplitudes = typename Basis<Shapes>::Amplitudes;
  using Normal = Eigen::Matrix<float, Shapes + 1, Shapes + 1>;
  constexpr int unknowns = Shapes + 1, more_than_unknowns = 4;
  InplaceVector<std::size_t, EdgeProfile::max_samples> used;
  Normal normal = Normal::Zero();
  Amplitudes light_sum = Amplitudes::Zero();
  for (std::size_t i = 0; i < profile.count; ++i) {
    if (!profile.usable[c][i]) continue;
    used.push_back(i);
    normal.noalias() += basis.row[i] * basis.row[i].transpose();
    light_sum.noalias() += profile.light[c][i] * basis.row[i];
  }
  const int samples = static_cast<int>(used.size());
  if (samples < unknowns + more_than_unknowns) return;
  normal.diagonal().array() += least_independent;
  const Eigen::LDLT<Normal> solver(normal);
  const Amplitudes amplitude = solver.solve(light_sum);
  // Derivatives of the model.
  std::array<float, EdgeProfile::max_samples> position, blur, miss;
  Amplitudes position_sum = Amplitudes::Zero(), blur_sum = Amplitudes::Zero();
  for (const std::size_t i : used) {
    position[i] = amplitude.template tail<Shapes>().dot(basis.by_position[i]);
    blur[i] = amplitude.template tail<Shapes>().dot(basis.by_blur[i]);
    miss[i] = profile.light[c][i] - amplitude.dot(basis.row[i]);
    position_sum += position[i] * basis.row[i];
    blur_sum += blur[i] * basis.row[i];
  }
  const Amplitudes position_part = solver.solve(position_sum), blur_part = solver.solve(blur_sum);
  for (const std::size_t i : used) {
    const float p = position[i] - position_part.dot(basis.row[i]), b = blur[i] - blur_part.dot(basis.row[i]);
    sums.position_gradient += p * miss[i];
    fit.information += p * p;
    fit.blur_gradient += b * miss[i];
    fit.blur_information += b * b;
    sums.position_and_blur += p * b;
    sums.squares += miss[i] * miss[i];
  }
  sums.degrees += samples - unknowns;
  fit.step[c] = amplitude.template tail<Shapes>().sum();
  fit.before[c] = amplitude[0];
}

// One variable-projection step: linear amplitudes per channel, then the position in what they leave.
template <int Shapes>
EdgeFit project(const EdgeProfile& profile, const Basis<Shapes>& basis) {
  EdgeFit fit;
  PositionSums sums;
  for (std::size_t c = 0; c < 3; ++c) add_channel(profile, basis, c, fit, sums);
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
