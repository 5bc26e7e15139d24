#pragma once

#include <functional>
#include <string>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"

namespace lapservo::internal {

/// Where the joints theta, phi, rho, psi (rad, m) are to be, by the time from its beginning. At rest at both ends,
/// within the limits' positions and accelerations, and slower than 0.8 of their rates.
struct JointMotion {
  double duration_s = 0;
  std::function<Eigen::Vector4d(double)> at;
};

/// By how much each joint swings to either side of `start` in a swing_motion().
Eigen::Vector4d swing_reach(const Eigen::Vector4d& start, const JointLimits& limits, double scale, double duration_s);

/// For `calibrate registration`: all joints at once, each with a period of its own, up to 0.25 rad, 0.2 rad, 10 mm and
/// 1 rad to either side of `start`, times `scale`, as far as limits and rates go. Ends where it starts.
JointMotion swing_motion(const Eigen::Vector4d& start, const JointLimits& limits, double scale, double duration_s);

/// For `calibrate marker`: psi a full turn and a little more, at no more than 0.3 rad/s, after it has gone to where
/// that begins, and back to `start`, these at up to half of its rate limit. Throws InputError naming `source` where the
/// limits leave no room for a turn.
JointMotion turn_motion(const Eigen::Vector4d& start, const JointLimits& limits, const std::string& source);

}  // namespace lapservo::internal
