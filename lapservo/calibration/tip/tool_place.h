#pragma once

#include <vector>

#include <Eigen/Core>

#include "lapservo/marker/marker.h"
#include "lapservo/tool/tool.h"

namespace lapservo::internal {

/// The tool so placed that at these readings of its wrist its tip lies there. The base's azimuth and the joints'
/// offsets stay as they are known, or unknown: of a tip that is measured at other readings the covariance counts them.
Tool placed_by_tip(Tool tool, const std::vector<double>& wrist_rad, const Eigen::Vector3d& tip_in_marker_m,
                   const Eigen::Matrix3d& covariance_m2);

/// The tool with its base, the tip of a straight one, on the shaft's axis, so far from the marker's distal edge.
Tool placed_by_calliper(Tool tool, const Marker& marker, double distance_m, double sigma_m);

/// Standard deviation of a base's place across the shaft's axis, where nothing else is known: film, glue, play.
inline constexpr double off_axis_sigma_m = 0.1e-3;

}  // namespace lapservo::internal
