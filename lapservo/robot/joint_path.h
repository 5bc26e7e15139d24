#pragma once

#include <Eigen/Core>

namespace lapservo {

/// Positions and velocities of the joints theta, phi, rho, psi: rad, m, rad/s, m/s.
struct MotionState {
  Eigen::Vector4d position = Eigen::Vector4d::Zero();
  Eigen::Vector4d velocity = Eigen::Vector4d::Zero();
};

/// The joints' setpoints over time, made of the controller's velocities for an arm that takes positions. Over each
/// period the velocity ramps linearly from where it is to the new one, so the path is continuously differentiable, its
/// rate never exceeds the larger of both velocities and its acceleration is their difference over the period. When no
/// new velocity comes in time the path brakes to rest, all joints in step, within the acceleration limits: a controller
/// that is late or gone leaves no jump and no runaway. A value: copies go their own way.
class JointPath {
 public:
  /// `acceleration`: by which it brakes, above 0: rad/s^2, m/s^2.
  explicit JointPath(const Eigen::Vector4d& acceleration) : acceleration_(acceleration) {}

  /// At rest there, from `time_s` on.
  void reset(double time_s, const Eigen::Vector4d& position);

  /// There from `time_s` on, with the velocity that it has then.
  void move_to(double time_s, const Eigen::Vector4d& position);

  /// From the path's state at `time_s` to `velocity` after `period_s`.
  void ramp_to(double time_s, const Eigen::Vector4d& velocity, double period_s);

  /// The path at any time from the start of the current period on, for an arm faster than the controller.
  MotionState at(double time_s) const;
  /// At the end of the current period.
  MotionState end() const { return at(start_s_ + period_s_); }

 private:
  Eigen::Vector4d acceleration_;
  MotionState start_;
  Eigen::Vector4d end_velocity_ = Eigen::Vector4d::Zero();
  double start_s_ = 0;
  double period_s_ = 0;
};

}  // namespace lapservo
