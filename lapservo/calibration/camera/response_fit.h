#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "lapservo/calibration/camera/board.h"
#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/geometry/response.h"

namespace lapservo::internal {

/// The usual responses, by their names in a rig.
std::vector<std::pair<std::string, Response>> named_responses();

struct ResponseFit {
  Response response;  ///< a named one unless the edges speak against it, else a table
  double sigma = 0;   ///< of encoded values (0 to 1), the largest over values that were seen, other responses included
  std::string nearest;                       ///< name of the most likely named response
  double low = 0, high = 1;                  ///< the values that were seen
  double sharpening = 0, sharpening_px = 0;  ///< unsharp mask: its strength and its blur
  double misfit = 0;                         ///< rms of values about the profiles, in units of their noise
};

/// The response from blurred edges of a board that lie where the geometry has them: bright and dark squares are equally
/// wide in light, a blurred edge is symmetric in light, and the squares' reflectances are the same wherever the board
/// is and however much light falls on it. Evenly lit edges leave it open by how much the response bends symmetrically
/// about the middle of their light. With `try_named` a named response is taken by model evidence. nullopt when edges
/// are too few or too alike.
std::optional<ResponseFit> fit_response(const std::vector<BoardEdgeProfile>& profiles, const Response& start,
                                        bool try_named, const AtIteration& at_iteration);

}  // namespace lapservo::internal
