#pragma once

#include <span>
#include <vector>

#include "lapservo/rcm/line_observation.h"

namespace lapservo {

/// One line per position: lines whose ends lie within 2 px of another's become their mean, with the covariance of one
/// of them, as frames of a shaft at rest share their errors. More than 1000 positions are merged, nearest first, until
/// 1000 are left. Unusable lines are left out. Takes linear time.
std::vector<LineObservation> distinct_lines(std::span<const LineObservation> lines);

}  // namespace lapservo
