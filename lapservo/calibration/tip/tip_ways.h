#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/calibration/tip/tip_fit.h"

namespace lapservo::internal {

/// From poses of a marker whose tip rests in a dimple while the shaft turns about it, with constant readings of the
/// wrist. Errors of the poses are alike over a second.
TipCalibration pivoted_tip(const Tool& tool, const std::vector<double>& wrist_rad, const std::vector<TimedPose>& poses);

/// From touches of points that lie still, in the order of `names`: five or more. A tip stands on its point to 0.1 mm.
TipCalibration touched_tip(const Tool& tool, const std::vector<TipSighting>& touches,
                           const std::vector<std::string>& names);

inline constexpr std::size_t least_touches = 5;

}  // namespace lapservo::internal
