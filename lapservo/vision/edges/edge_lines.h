#pragma once

#include <algorithm>
#include <span>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/edges/edge_profile.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

/// A line in the raw image across an edge, sampled every pixel. All of it must lie inside the image
/// (LightImage::contains).
struct EdgeLine {
  float u_px = 0, v_px = 0;     ///< where the edge is expected
  float du = 1, dv = 0;         ///< unit direction; offsets count along it
  int before = 0, after = 0;    ///< samples on either side, at most EdgeProfile::max_samples - 1 together
  float blur_px = 1;            ///< of the edge along the line, one sigma
  float contour_radius_px = 0;  ///< for locate_contours
};

/// How far a line across a shaft's side reaches out of it and into it: of so wide a blur and, where the side's place is
/// not known to a fraction of it, some more.
inline int outside_of_side_px(double blur_px, double extra_px) {
  return static_cast<int>(std::min(2.5 * blur_px + extra_px, 14.0));
}
inline int inside_of_side_px(double radius_px) {
  return static_cast<int>(std::min(0.34 * radius_px, 26.0));
}

inline constexpr std::size_t max_edge_lines = 512;
using EdgeFits = InplaceVector<EdgeFit, max_edge_lines>;

/// The light along a line; fit_step and fit_contour of it.
EdgeProfile sample_profile(const LightImage& light, const EdgeLine& line);
EdgeFit locate_step(const LightImage& light, const EdgeLine& line, int iterations);
EdgeFit locate_contour(const LightImage& light, const EdgeLine& line, int iterations);

/// The same for many lines, several at once in the lanes of the processor's vectors (Highway, chosen when run): one fit
/// a line, equal to rounding. More than max_edge_lines: std::length_error.
EdgeFits locate_steps(const LightImage& light, std::span<const EdgeLine> lines, int iterations);
EdgeFits locate_contours(const LightImage& light, std::span<const EdgeLine> lines, int iterations);

}  // namespace lapservo::internal
