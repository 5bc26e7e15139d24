#pragma once

#include <array>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/robot/joint_path.h"

namespace lapservo::internal {

/// What lies between set-points and measured joints, joint by joint.
struct DriveState {
  /// Half of what a set-point goes after it has turned before the joint follows: Coulomb friction over the servo's
  /// gain.
  Eigen::Vector4d friction = Eigen::Vector4d::Zero();
  /// Set-point less measured joint in the middle of that: what the arm sags by under its weight.
  Eigen::Vector4d load = Eigen::Vector4d::Zero();
  /// The joint has gone both ways, and some way since set-points began anew. Before, it may hang on its friction, and
  /// `load` be off by as much.
  std::array<bool, 4> load_known{};
  /// Of the measured joints, between the last two.
  Eigen::Vector4d velocity = Eigen::Vector4d::Zero();
  /// The joint goes where its set-point goes, nearly as fast.
  std::array<bool, 4> follows{};
};

/// What an arm makes of its set-points: least squares of set-point - measured joint = lag * velocity + load + friction
/// * direction over the last seconds of motion, one lag for all joints. Only joints that move count: one that is
/// blocked tells nothing of these. Friction counts from when a joint has gone both ways.
class ArmResponse {
 public:
  explicit ArmResponse(const Scales& scales) : scales_(scales) {}

  /// Set-point and measured joints of one time, `interval_s` after the ones before.
  void add(const MotionState& setpoint, const Eigen::Vector4d& q_joint, double interval_s);
  /// Set-points start anew at the measured joints: load and velocity are not known any more.
  void restart();

  /// How far the arm lags behind moving set-points: 0 before there was motion, never more than 0.1 s. The desired
  /// motion is fed forward that much earlier.
  double lag_s() const { return lag_s_; }
  const DriveState& drive() const { return drive_; }

 private:
  static constexpr int unknowns = 9;  // lag; the joints' loads; their frictions
  using Unknowns = Eigen::Matrix<double, unknowns, 1>;
  bool follows(int joint, double setpoint_velocity) const;
  bool has_moved(int joint) const { return normal_(1 + joint, 1 + joint) > 0; }
  void solve();

  Scales scales_;
  Eigen::Vector4d q_before_ = Eigen::Vector4d::Zero(), velocity_ = Eigen::Vector4d::Zero(),
                  smooth_velocity_ = velocity_, smooth_setpoint_velocity_ = velocity_;
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
