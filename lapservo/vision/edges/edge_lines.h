#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/edges/film_edge.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

/// A line in the raw image across an edge, sampled every pixel. LightImage::contains() all of it.
struct EdgeLine {
  static constexpr int max_reach = 22;  ///< of a line that reaches as far on both sides
  static constexpr std::size_t max_samples = 2 * max_reach + 1;
  float u_px = 0, v_px = 0;   ///< where the edge is expected
  float du = 1, dv = 0;       ///< unit direction; offsets count along it
  int before = 0, after = 0;  ///< samples on either side, at most max_samples - 1 together
  float blur_px = 1;          ///< of the edge along the line, one sigma
  /// 0: a step between two flat stretches. Else the occluding contour of a diffusely lit cylinder of this radius with
  /// the light near the camera: beyond the background ambient and diffuse light, which rises along the line.
  float contour_radius_px = 0;
};

/// Where the edge is, by least squares over the three channels with amplitudes free in each.
struct EdgeFit {
  bool converged = false;
  float offset_px = 0;                            ///< of the edge from where it is expected
  float information = 0;                          ///< inverse variance of offset_px for unit noise in the light, 1/px^2
  float residual_variance = 0;                    ///< of the light about the model
  std::array<float, 3> step{};                    ///< change of the light over the edge; 0 of a channel without samples
  std::array<float, 3> before{};                  ///< light before the edge, likewise
  float blur_gradient = 0, blur_information = 0;  ///< Gauss-Newton terms of the blur, for unit noise
};

/// An edge that an only iteration moves farther is not converged.
inline constexpr float max_only_step_px = 1.5F;

inline constexpr std::size_t max_edge_lines = 4 * max_end_points;  ///< a pass's, of its four boundaries
using EdgeFits = InplaceVector<EdgeFit, max_edge_lines>;

/// Takes up to `iterations` Gauss-Newton steps on each of several lines across edges of one kind, several at once in
/// the lanes of the processor's vectors (Highway, chosen when run): one fit a line, the same up to rounding whichever
/// lines it is among. Saturated samples of a channel do not count. More than max_edge_lines: std::length_error.
EdgeFits locate_edges(const LightImage& light, std::span<const EdgeLine> lines, int iterations);

}  // namespace lapservo::internal
