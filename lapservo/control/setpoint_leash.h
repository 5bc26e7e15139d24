#pragma once

#include <Eigen/Core>

#include "lapservo/control/arm_response.h"
#include "lapservo/control/controller_config.h"
#include "lapservo/robot/joint_path.h"

namespace lapservo::internal {

/// Keeps set-points from running ahead of a joint that does not come along. What drives a joint is how far its
/// set-point is ahead of it, so that a joint that something has blocked moves about as fast when it is released as
/// ahead / lag, and a little faster by what its transmission has wound up. Allowed is a lead of 0.9 x the rate limit x
/// the lag, beside friction and load; 0.7 x until the load is known. A joint that is farther from its set-point and
/// goes along with it all the same is not blocked: the arm hangs lower, or its encoder was set, and the lead is counted
/// from there.
class SetpointLeash {
 public:
  explicit SetpointLeash(const JointLimits& limits) : limits_(limits) {}

  /// Once a tick: the joints as they are measured, their set-points, and what is known of the arm.
  void update(const MotionState& setpoint, const Eigen::Vector4d& q_joint, const DriveState& drive, double lag_s,
              double interval_s);
  /// The next update() counts leads from where the joints are then, blocked or not: their encoders were set.
  void restart() { restarted_ = true; }
  /// A set-point has been at the end of its leash for some time: its joint is blocked, or not where it is measured.
  bool taut() const;
  /// `wanted`, so slowed that no set-point leaves its leash; one that is beyond it comes back. Within rate and
  /// acceleration limits.
  Eigen::Vector4d limit(const Eigen::Vector4d& setpoint_velocity, const Eigen::Vector4d& wanted, double period_s) const;

 private:
  JointLimits limits_;
  DriveState drive_;
  Eigen::Vector4d allowed_ = Eigen::Vector4d::Zero(), ahead_ = Eigen::Vector4d::Zero();
  Eigen::Vector4d beyond_ = Eigen::Vector4d::Zero();  // of what is ahead, what the joint goes along with
  double taut_s_ = 0;
  bool restarted_ = false;
};

}  // namespace lapservo::internal
