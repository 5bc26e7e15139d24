#include "lapservo/vision/edges/edge_profile.h"

#include <algorithm>
#include <cmath>

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

Basis<1> step_basis(const EdgeProfile& profile, float edge_px, float blur_px) {
  Basis<1> basis;
  const BlurredEdges& edges = BlurredEdges::instance();
  for (std::size_t i = 0; i < profile.count; ++i) {
    const float u = (profile.first_px + static_cast<float>(i) - edge_px) / blur_px;
    const BlurredEdge edge = edges.at(u);
    basis.value[0][i] = edge.step;
    basis.by_position[0][i] = -edge.density / blur_px;
    basis.by_blur[0][i] = -edge.density * u / blur_px;
  }
  return basis;
}

// sqrt(1 - (1 - d/R)^2) = sqrt(2 d / R) (1 - d / 4R - ...): the occluding contour within a third of the radius.
Basis<2> contour_basis(const EdgeProfile& profile, float edge_px, float blur_px, float radius_px) {
  Basis<2> basis;
  const BlurredEdges& edges = BlurredEdges::instance();
  const float scale = std::sqrt(2 / radius_px), root_blur = std::sqrt(blur_px);
  for (std::size_t i = 0; i < profile.count; ++i) {
    const float u = (profile.first_px + static_cast<float>(i) - edge_px) / blur_px;
    const BlurredEdge edge = edges.at(u);
    basis.value[0][i] = edge.step;
    basis.by_position[0][i] = -edge.density / blur_px;
    basis.value[1][i] = scale * root_blur * (edge.root - blur_px * edge.three_halves / (4 * radius_px));
    basis.by_position[1][i] = -scale / root_blur * (edge.root_slope - blur_px * 1.5F * edge.root / (4 * radius_px));
    basis.by_blur[0][i] = -edge.density * u / blur_px;
    basis.by_blur[1][i] = scale / root_blur * (0.5F * edge.root - u * edge.root_slope);
  }
  return basis;
}

// One variable-projection step: linear amplitudes per channel, then the position in what they leave.
template <int Shapes>
EdgeFit project(const EdgeProfile& profile, const Basis<Shapes>& basis) {
  constexpr int linear = Shapes + 1;
  using Matrix = Eigen::Matrix<float, linear, linear>;
  using Vector = Eigen::Matrix<float, linear, 1>;
  EdgeFit fit;
  float position_gradient = 0, position_and_blur = 0, squares = 0;
  int degrees = -1;
  for (std::size_t c = 0; c < 3; ++c) {
    Matrix normal = Matrix::Zero();
    Vector light_sum = Vector::Zero();
    int used = 0;
    const auto row = [&](std::size_t i) {
      Vector a;
      a[0] = 1;
      for (int s = 0; s < Shapes; ++s) a[s + 1] = basis.value[static_cast<std::size_t>(s)][i];
      return a;
    };
    for (std::size_t i = 0; i < profile.count; ++i) {
      if (!profile.usable[c][i]) continue;
      const Vector a = row(i);
      normal.noalias() += a * a.transpose();
      light_sum.noalias() += profile.light[c][i] * a;
      ++used;
    }
    if (used < linear + 4) continue;
    normal.diagonal().array() += 1e-5F;
    const Eigen::LDLT<Matrix> solver(normal);
    const Vector amplitude = solver.solve(light_sum);

    // Derivatives of the model, and their parts that the amplitudes can't imitate.
    std::array<float, EdgeProfile::max_samples> position, blur, miss;
    Vector position_sum = Vector::Zero(), blur_sum = Vector::Zero();
    for (std::size_t i = 0; i < profile.count; ++i) {
      if (!profile.usable[c][i]) continue;
      const Vector a = row(i);
      position[i] = blur[i] = 0;
      for (int s = 0; s < Shapes; ++s) {
        position[i] += amplitude[s + 1] * basis.by_position[static_cast<std::size_t>(s)][i];
        blur[i] += amplitude[s + 1] * basis.by_blur[static_cast<std::size_t>(s)][i];
      }
      miss[i] = profile.light[c][i] - amplitude.dot(a);
      position_sum += position[i] * a;
      blur_sum += blur[i] * a;
    }
    const Vector position_part = solver.solve(position_sum), blur_part = solver.solve(blur_sum);
    for (std::size_t i = 0; i < profile.count; ++i) {
      if (!profile.usable[c][i]) continue;
      const Vector a = row(i);
      const float p = position[i] - position_part.dot(a), b = blur[i] - blur_part.dot(a);
      position_gradient += p * miss[i];
      fit.information += p * p;
      fit.blur_gradient += b * miss[i];
      fit.blur_information += b * b;
      position_and_blur += p * b;
      squares += miss[i] * miss[i];
    }
    degrees += used - linear;
    fit.step[c] = amplitude.tail(Shapes).sum();
    fit.before[c] = amplitude[0];
  }
  if (degrees < 3 || !(fit.information > min_edge_information)) return fit;
  fit.offset_px = position_gradient / fit.information;
  // Of the blur, whatever the position is.
  fit.blur_gradient -= fit.offset_px * position_and_blur;
  fit.blur_information -= position_and_blur * position_and_blur / fit.information;
  fit.residual_variance = squares / static_cast<float>(degrees);
  fit.converged = std::isfinite(fit.offset_px) && std::isfinite(fit.residual_variance);
  return fit;
}

template <typename MakeBasis>
EdgeFit iterate(const EdgeProfile& profile, int iterations, const MakeBasis& basis_at) {
  float edge_px = 0;
  EdgeFit fit;
  const float reach_px = static_cast<float>(profile.count) / 2;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    fit = project(profile, basis_at(edge_px));
    if (!fit.converged) return fit;
    const float step_px = std::clamp(fit.offset_px, -2.0F, 2.0F);
    edge_px += step_px;
    if (std::abs(edge_px) > reach_px) {
      fit.converged = false;
      return fit;
    }
    if (std::abs(step_px) < edge_tolerance_px) break;
  }
  fit.converged = std::abs(fit.offset_px) < (iterations > 1 ? max_last_step_px : max_only_step_px);
  fit.offset_px = edge_px;
  return fit;
}

}  // namespace

EdgeFit fit_step(const EdgeProfile& profile, float blur_px, int iterations) {
  return iterate(profile, iterations, [&](float edge_px) { return step_basis(profile, edge_px, blur_px); });
}

EdgeFit fit_contour(const EdgeProfile& profile, float blur_px, float radius_px, int iterations) {
  return iterate(profile, iterations,
                 [&](float edge_px) { return contour_basis(profile, edge_px, blur_px, radius_px); });
}

}  // namespace lapservo::internal
