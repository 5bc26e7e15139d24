#pragma once

#include <array>
#include <span>

#include "lapservo/vision/edges/edge_measurements.h"

namespace lapservo::internal {

/// A group's residuals as a straight line over the print: of boundaries in metres along the shaft, of sides a constant
/// in pixels. Zero where a group has too few points for one of its own.
struct ResidualLine {
  double at_start = 0, slope = 0;  ///< at tau = 0; a turn

  /// The rest of a residual after the line.
  double residual_px(const Measurement& m) const;
};
using ResidualLines = std::array<ResidualLine, measurement_groups>;

ResidualLines residual_lines(std::span<const Measurement> measurements);

/// Root mean square of the boundaries' residuals in sigmas, each about its own line; outliers do not count.
double scatter_sigmas(std::span<const Measurement> measurements, const ResidualLines& lines);

}  // namespace lapservo::internal
