#pragma once

#include <Eigen/Core>

#include "lapservo/control/arm_response.h"
#include "lapservo/control/controller_config.h"
#include "lapservo/control/motion_limits.h"
#include "lapservo/robot/joint_path.h"

namespace lapservo::internal {

/// Limits how far setpoints run ahead of a joint that does not follow. The lead drives the joint: a blocked joint
/// moves, once released, at about lead / lag, and a little faster by the wound-up transmission. The limit of the lead
/// is 0.9 x the rate limit x the lag, plus friction and load; 0.7 x until the load is known. A joint with a larger lead
/// that follows nevertheless is not blocked: the arm hangs lower, or its encoder was set, and the lead counts from
/// there.
class FollowingErrorLimit {
 public:
  explicit FollowingErrorLimit(const JointLimits& limits) : limits_(limits) {}

  /// Call it once per tick with the setpoints, the measured joints and the estimates of the arm's response.
  void update(const MotionState& setpoint, const Eigen::Vector4d& q_joint, const DriveState& drive, double lag_s,
              double interval_s);
  /// The next update() counts leads from where the joints are then, blocked or not: their encoders were set.
  void restart() { restarted_ = true; }
  /// A setpoint has been at its limit for some time: its joint is blocked, or not where it is measured.
  bool is_reached() const;
  /// Velocities, none beyond `rate`, by which no setpoint exceeds its limit; one that does comes back.
  VelocityRange range(const Eigen::Vector4d& rate) const;

 private:
  JointLimits limits_;
  DriveState drive_;
  Eigen::Vector4d allowed_ = Eigen::Vector4d::Zero(), ahead_ = Eigen::Vector4d::Zero();
  Eigen::Vector4d beyond_ = Eigen::Vector4d::Zero();  // the part of the lead with which the joint follows
  double reached_s_ = 0;
  bool restarted_ = false;
};

}  // namespace lapservo::internal
