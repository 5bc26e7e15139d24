#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "lapservo/rcm/line_observation.h"

namespace lapservo {

/// One line per position: lines whose ends lie within `apart_px` of another's become their mean, with the covariance of
/// one of them, as frames of a shaft at rest share their errors. More than `most` positions are merged, nearest first,
/// until `most` are left. Unusable lines are left out. Takes linear time.
std::vector<LineObservation> distinct_lines(std::span<const LineObservation> lines, double apart_px = 2,
                                            std::size_t most = 1000);

}  // namespace lapservo
