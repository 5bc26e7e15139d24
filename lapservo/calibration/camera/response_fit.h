#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/camera/board_edge_profile.h"
#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/geometry/response.h"

namespace lapservo::internal {

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
/// is and however much light falls on it. With `try_named` a named response is taken where it explains the edges as
/// well. nullopt when edges are too few or too alike.
std::optional<ResponseFit> fit_response(const std::vector<BoardEdgeProfile>& profiles, const Response& start,
                                        bool try_named, const AtIteration& at_iteration);

}  // namespace lapservo::internal
