#pragma once

#include <Eigen/Core>

#include "lapservo/sim/simulated_arm.h"

namespace lapservo {

/// The response of a real arm to its setpoints. Joints: theta_rad, phi_rad, rho_m, psi_rad.
struct ArmConfig {
  Eigen::Vector4d lower{-1.2, 0.5, 0.02, -4.6};  ///< of the measured joints
  Eigen::Vector4d upper{1.2, 2.6, 0.22, 4.6};
  Eigen::Vector4d rate{1.5, 1.5, 0.15, 6};             ///< the motors' largest speeds, rad/s and m/s
  double lag_s = 0.02;                                 ///< first order, from setpoint to motor
  Eigen::Vector4d resolution{1e-5, 1e-5, 2e-6, 1e-4};  ///< of the encoders
  Eigen::Vector4d backlash{0, 0, 1e-4, 0.02};          ///< full backlash between motor and instrument
  /// Instrument less measured joints, when the backlash is in the middle: 2 degrees and 3 mm.
  Eigen::Vector4d joint_offset{0.0349, -0.0349, 0.003, 0.0349};
  /// Where the true RCM lies in the RCM frame of the rig. Not zero: the rig is registered wrongly too.
  Eigen::Vector3d rcm_offset_m = Eigen::Vector3d::Zero();

  /// Returns itself if all its numbers make sense; else throws InputError naming the first field that doesn't.
  const ArmConfig& checked() const;
};

/// First order: light, for fast tests. Between setpoints its motion is exact, however finely it is stepped.
class Arm : public SimulatedArm {
 public:
  /// At rest with these measured joints, which must lie within the limits (else InputError).
  Arm(const ArmConfig& config, const Eigen::Vector4d& q_measured);

  void servo_jp(const Eigen::Vector4d& setpoint) override;
  void step(double dt_s) override;
  Eigen::Vector4d measured_jp() const override;
  /// The motors' positions through backlash and offsets.
  Eigen::Vector4d true_jp() const override { return q_driven_ + config_.joint_offset; }
  bool faulted() const override { return faulted_; }
  void fault() override;
  void recover() override;

 private:
  ArmConfig config_;
  Eigen::Vector4d setpoint_, motor_, q_driven_;
  bool faulted_ = false;
};

}  // namespace lapservo
