#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/board_edges.h"
#include "lapservo/geometry/response.h"

namespace lapservo::internal {

/// A channel's encoded values (0 to 1) across an edge, from dark to bright, at distances of `profile_step_px` about the
/// edge; NaN where there is none. Means of light, encoded again: noise comes before the response.
struct BoardEdgeProfile {
  std::vector<double> value, sigma;
  double dark = 0, bright = 0;  ///< values of the squares beside it
  double blur_px = 1;
  double angle_rad = 0;  ///< between the edge and the nearer of rows and columns, 0 to pi/4
};
constexpr double profile_step_px = 0.5;

/// nullopt where the edge shows no two levels.
std::optional<BoardEdgeProfile> profile_of(const EdgePixels& edge, int towards_bright, int channel, double blur_px,
                                           const Response& response);

struct ResponseFit {
  Response response;          ///< a named one where it fits as well, else a table
  Response table;             ///< as it was fitted
  double sigma = 0;           ///< of encoded values (0 to 1), the largest over values that were seen
  double named_distance = 0;  ///< the largest difference of values between `table` and the nearest named response
  std::string nearest;        ///< that one's name
  double low = 0, high = 1;   ///< the values that were seen
  double sharpening = 0, sharpening_px = 0;  ///< unsharp mask: its strength and its blur
  std::array<double, 2> misfit{};            ///< rms of values about the profiles, before (as started) and after
};

/// The response from blurred edges of a board that lie where the geometry has them: bright and dark squares are equally
/// wide in light, a blurred edge is symmetric in light, and the squares' reflectances are the same wherever the board
/// is and however much light falls on it. With `try_named` a named response is taken where it explains
/// the edges as well. nullopt when edges are too few or too alike to tell.
std::optional<ResponseFit> fit_response(const std::vector<BoardEdgeProfile>& profiles, const Response& start,
                                        bool try_named);

}  // namespace lapservo::internal
