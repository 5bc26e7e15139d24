#pragma once

#include <Eigen/Core>

#include "lapservo/control/motion_limits.h"

namespace lapservo {

/// Turns the controller's velocities into a smooth path for an arm that takes positions. Over each period the velocity
/// ramps linearly from the last one to the new one, so the path is continuously differentiable, its rate never exceeds
/// the larger of both velocities and its acceleration is their difference over the period.
class SetpointInterpolator {
 public:
  /// At rest there, from `time_s` on.
  void reset(double time_s, const Eigen::Vector4d& position);

  /// Starts the next period at the end of the one before (or at `time_s`, when that is later: in between the arm holds
  /// at the last velocity's end position), reaching `velocity` after `period_s`.
  void ramp_to(double time_s, const Eigen::Vector4d& velocity, double period_s);

  /// The path at any time, for an arm faster than the controller; before the current period its start, after it its
  /// end.
  MotionState at(double time_s) const;
  /// At the end of the current period.
  MotionState end() const { return at(start_s_ + period_s_); }

 private:
  MotionState start_;
  Eigen::Vector4d end_velocity_ = Eigen::Vector4d::Zero();
  double start_s_ = 0;
  double period_s_ = 0;
};

}  // namespace lapservo
