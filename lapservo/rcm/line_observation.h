#pragma once

#include <optional>

#include <Eigen/Core>

namespace lapservo {

/// One image of an instrument's centre line: two points on it, ideal pixels, for example e0 and e3.
///
/// The centre line needs no correction for the shaft's radius. It is the image of the facing generatrix, a line of the
/// surface beside the axis, but both lie in one plane with the camera centre (that is what "facing" means), so both
/// have the same image line, and the RCM on the axis projects onto it. Only undistorted pixels have this property, and
/// only observations that were fitted without knowing the RCM say anything about it.
struct LineObservation {
  Eigen::Vector2d from_px = Eigen::Vector2d::Zero(), to_px = Eigen::Vector2d::Zero();
  Eigen::Matrix4d covariance_px2 = Eigen::Matrix4d::Identity();  ///< of [from; to], positive definite
};

/// With independent errors of one standard deviation in every coordinate of both points.
LineObservation line_between(const Eigen::Vector2d& from_px, const Eigen::Vector2d& to_px, double sigma_px);

/// Everything finite, the points apart and no farther away than pixels can be (1e9).
bool is_usable(const LineObservation& line);

/// Where the extended lines meet; nullopt when they are parallel to rounding.
std::optional<Eigen::Vector2d> intersection_px(const LineObservation& a, const LineObservation& b);

}  // namespace lapservo
