#pragma once

#include <array>
#include <cstddef>

namespace lapservo::internal {

/// Light along a short line across an edge: sample i lies at (first_px + i) px from where the edge is expected.
struct EdgeProfile {
  static constexpr int max_reach = 22;  ///< of a line that reaches as far on both sides
  static constexpr std::size_t max_samples = 2 * max_reach + 1;
  float first_px = 0;
  std::size_t count = 0;
  std::array<std::array<float, max_samples>, 3> light;
  std::array<std::array<bool, max_samples>, 3> usable;  ///< false where saturated
};

/// Where the edge is, by least squares over the three channels with amplitudes free in each.
struct EdgeFit {
  bool converged = false;
  float offset_px = 0;                            ///< of the edge from where it is expected
  float information = 0;                          ///< inverse variance of offset_px for unit noise in the light, 1/px^2
  float residual_variance = 0;                    ///< of the light about the model
  std::array<float, 3> step{};                    ///< change of the light over the edge, per channel
  std::array<float, 3> before{};                  ///< light before the edge
  float blur_gradient = 0, blur_information = 0;  ///< Gauss-Newton terms of the blur, for unit noise
};

/// An edge with less information has no contrast.
inline constexpr float min_edge_information = 1e-9F;
/// A shape that differs from the others by less than this part of its square is not set apart by it.
inline constexpr float least_independent = 1e-5F;
/// Iterations end below the first; the last of several may move the edge by the second, an only one by the third.
inline constexpr float edge_tolerance_px = 0.004F, max_last_step_px = 0.25F, max_only_step_px = 1.5F;

/// A step between two flat stretches, blurred by `blur_px`. Takes up to `iterations` Gauss-Newton steps.
EdgeFit fit_step(const EdgeProfile& profile, float blur_px, int iterations);

/// The true occluding contour of a diffusely lit cylinder of radius `radius_px` with the light near the camera: beyond
/// the background, for x > 0, ambient plus diffuse light that rises like sqrt(1 - (1 - x / R)^2), blurred.
EdgeFit fit_contour(const EdgeProfile& profile, float blur_px, float radius_px, int iterations);

}  // namespace lapservo::internal
