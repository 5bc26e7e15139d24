#pragma once

#include <Eigen/Core>

#include "lapservo/control/motion_limits.h"
#include "lapservo/control/offset_observer.h"

namespace lapservo::internal {

/// `wanted` plus what takes the motors quickly through the rest of their gaps when the desired motion has turned:
/// while the instrument stands still whatever the motor does, it falls behind. Only joints whose wanted motion is that
/// of the desired features (`feed_forward`), so that noise about a set-point does not send motors to and fro. The
/// addition vanishes towards the gap's end and stays within rate and acceleration limits: a joint that can't cross
/// faster must not make limit_velocity bend the others.
Eigen::Vector4d cross_gaps(const JointLimits& limits, const MotionState& motion, const GapState& gap,
                           const Eigen::Vector4d& q_joint, const Eigen::Vector4d& feed_forward,
                           const Eigen::Vector4d& wanted, double period_s);

}  // namespace lapservo::internal
