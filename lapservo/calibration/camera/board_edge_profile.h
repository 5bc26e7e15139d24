#pragma once

#include <optional>
#include <vector>

#include "lapservo/calibration/camera/board_edges.h"
#include "lapservo/geometry/response.h"

namespace lapservo::internal {

/// A channel's encoded values (0 to 1) across an edge, from dark to bright, in steps of `profile_step_px` about the
/// edge; NaN where there is none. Means of light, encoded again: noise comes before the response.
struct BoardEdgeProfile {
  std::vector<double> value, sigma;
  std::vector<double> at_px, spread_px2;  ///< distances of a step's pixels: their mean and variance
  double dark = 0, bright = 0;            ///< values of the squares beside it
  double blur_px = 1;
  double angle_rad = 0;  ///< between the edge and the nearer of rows and columns, 0 to pi/4
};
constexpr double profile_step_px = 0.5;

/// nullopt where the edge shows no two levels.
std::optional<BoardEdgeProfile> profile_of(const EdgePixels& edge, int towards_bright, int channel, double blur_px,
                                           const Response& response);

}  // namespace lapservo::internal
