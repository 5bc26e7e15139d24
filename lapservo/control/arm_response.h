#pragma once

#include <array>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/robot/joint_path.h"

namespace lapservo::internal {

/// The difference between setpoints and measured joints, per joint.
struct DriveState {
  /// Half of the distance by which a setpoint moves after a reversal before the joint follows: Coulomb friction over
  /// the servo's gain.
  Eigen::Vector4d friction = Eigen::Vector4d::Zero();
  /// Setpoint less measured joint in the middle of that interval: the sag of the arm under its weight.
  Eigen::Vector4d load = Eigen::Vector4d::Zero();
  /// The joint has moved in both directions, and some distance since the setpoints restarted. Before that it may hang
  /// on its friction, and `load` may be wrong by as much.
  std::array<bool, 4> load_known{};
  /// Rates of the measured joints between the last two readings.
  Eigen::Vector4d velocity = Eigen::Vector4d::Zero();
  /// The joint follows its setpoint at nearly the same rate.
  std::array<bool, 4> follows{};
};

/// Estimates how an arm responds to setpoints: least squares of setpoint - measured joint = lag * velocity + load +
/// friction * direction over the last seconds of motion, one lag for all joints. Only joints that move count: a blocked
/// joint carries no information. Friction counts once a joint has moved in both directions.
class ArmResponse {
 public:
  explicit ArmResponse(const Scales& scales) : scales_(scales) {}

  /// Setpoint and measured joints of one time, `interval_s` after the previous ones.
  void add(const MotionState& setpoint, const Eigen::Vector4d& q_joint, double interval_s);
  /// Setpoints restart at the measured joints: load and velocity become unknown.
  void restart();

  /// Lag of the arm behind moving setpoints: 0 before any motion, at most 0.1 s. The desired motion is fed forward by
  /// that time.
  double lag_s() const { return lag_s_; }
  const DriveState& drive() const { return drive_; }

 private:
  static constexpr int unknowns = 9;  // lag; the joints' loads; their frictions
  using Unknowns = Eigen::Matrix<double, unknowns, 1>;
  bool follows(int joint, double setpoint_velocity) const;
  bool has_moved(int joint) const { return normal_(1 + joint, 1 + joint) > 0; }
  void solve();

  Scales scales_;
  Eigen::Vector4d q_before_ = Eigen::Vector4d::Zero(), smooth_velocity_ = q_before_,
                  smooth_setpoint_velocity_ = q_before_;
  Eigen::Vector4d standing_load_ = Eigen::Vector4d::Zero();
  bool started_ = false, asked_ = false;
  // In joint scales.
  Eigen::Matrix<double, unknowns, unknowns> normal_ = Eigen::Matrix<double, unknowns, unknowns>::Zero();
  Unknowns cross_ = Unknowns::Zero();
  Eigen::Array4d rising_s_ = Eigen::Array4d::Zero(), falling_s_ = Eigen::Array4d::Zero();
  double lag_s_ = 0;
  DriveState drive_;
};

}  // namespace lapservo::internal
