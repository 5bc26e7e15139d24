#pragma once

#include <span>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/vision/edges/edge_profile.h"
#include "lapservo/vision/edges/film_edge.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

/// A line in the raw image across an edge, sampled every pixel. LightImage::contains() all of it.
struct EdgeLine {
  float u_px = 0, v_px = 0;     ///< where the edge is expected
  float du = 1, dv = 0;         ///< unit direction; offsets count along it
  int before = 0, after = 0;    ///< samples on either side, at most EdgeProfile::max_samples - 1 together
  float blur_px = 1;            ///< of the edge along the line, one sigma
  float contour_radius_px = 0;  ///< of the shaft whose occluding contour the edge is; 0 of a step
};

inline constexpr std::size_t max_edge_lines = 4 * max_end_points;  ///< a pass's, of its four boundaries
using EdgeFits = InplaceVector<EdgeFit, max_edge_lines>;

/// By the light along a line: fit_step or fit_contour.
EdgeFit locate_edge(const LightImage& light, const EdgeLine& line, int iterations);

/// The same for many lines across edges of one kind, several at once in the lanes of the processor's vectors (Highway,
/// chosen when run): one fit a line, equal to rounding. More than max_edge_lines: std::length_error.
EdgeFits locate_edges(const LightImage& light, std::span<const EdgeLine> lines, int iterations);

}  // namespace lapservo::internal
