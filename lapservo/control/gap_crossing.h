#pragma once

#include <Eigen/Core>

#include "lapservo/control/arm_response.h"
#include "lapservo/control/estimate.h"

namespace lapservo::internal {

/// Speed at a distance from where to end: slows down at half the acceleration, and the last part exponentially.
double closing_speed(double left, double acceleration);

/// Adds to `wanted` the motion that takes the setpoints quickly through the rest of the dead zone between them and the
/// instrument after the desired motion has reversed: the drives' friction (`drive`), then the motors' gaps (`gap`).
/// While the instrument does not respond to the setpoint, it falls behind. Applies only to joints whose wanted motion
/// is that of the desired features (`feed_forward`), so that noise about a setpoint does not move motors to and fro.
/// The addition vanishes towards the gap's end and stays within rate and acceleration limits: a joint that can't cross
/// faster must not make limit_velocity bend the others.
Eigen::Vector4d cross_gaps(const JointLimits& limits, const MotionState& motion, const GapState& gap,
                           const DriveState& drive, const Eigen::Vector4d& q_joint, const Eigen::Vector4d& feed_forward,
                           const Eigen::Vector4d& wanted, double period_s);

}  // namespace lapservo::internal
