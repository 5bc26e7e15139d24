#pragma once

#include <memory>

#include <Eigen/Core>

#include "lapservo/sim/arm.h"

namespace lapservo::internal {

/// The masses, drives and transmissions of an arm of a PSM's size. Joints: theta, phi, rho, psi; what is of a joint is
/// in rad, N m, kg m^2, or for rho in m, N, kg.
struct MujocoArmConfig {
  /// Limits and encoders, backlash and joint offset: of ArmConfig, whose rate and lag_s don't count.
  ArmConfig joints;
  double carriage_kg = 0.3;         ///< what insertion moves: the instrument with its drives
  double carriage_behind_m = 0.25;  ///< its centre, from the marker's proximal end towards the arm, along the shaft
  Eigen::Vector3d gravity_in_rcm{6.9, 0, -6.9};            ///< m/s^2, in the RCM's frame
  Eigen::Vector4d motor_inertia{0.03, 0.03, 1, 1e-4};      ///< reflected to the joint
  Eigen::Vector4d link_inertia{0.03, 0.03, 0, 2e-5};       ///< beside the carriage's
  Eigen::Vector4d stiffness{2000, 2000, 40000, 8};         ///< of the transmissions: N m/rad, N/m
  Eigen::Vector4d transmission_damping{3, 3, 60, 4e-3};    ///< N m s/rad, N s/m
  Eigen::Vector4d friction{0.1, 0.1, 1, 0.004};            ///< Coulomb's, at the motors: N m, N
  Eigen::Vector4d proportional_gain{350, 350, 5000, 0.5};  ///< of the servos: N m/rad, N/m
  Eigen::Vector4d derivative_gain{7, 7, 100, 0.01};        ///< N m s/rad, N s/m
  Eigen::Vector4d largest_force{10, 10, 30, 0.2};          ///< of the motors: N m, N
};

/// An arm whose dynamics are MuJoCo's, in steps of 1 ms: each joint has a motor with a PD servo, friction and an
/// encoder, and moves its link through an elastic transmission with backlash; gravity pulls.
class MujocoArm {
 public:
  /// At rest with these measured joints: the servos bear the weight.
  MujocoArm(const MujocoArmConfig& config, const Eigen::Vector4d& q_measured);
  ~MujocoArm();

  void servo_jp(const Eigen::Vector4d& setpoint);
  void step(double dt_s);
  Eigen::Vector4d measured_jp() const;
  Eigen::Vector4d true_jp() const;
  Eigen::Vector4d true_velocity() const;
  const Eigen::Vector4d& setpoint() const { return setpoint_; }
  /// Something keeps the link of this joint (0 to 3) where it is, until release().
  void block(int joint);
  void release(int joint);

 private:
  struct Physics;
  void physics_step();
  Eigen::Vector4d motors() const;

  MujocoArmConfig config_;
  std::unique_ptr<Physics> physics_;
  Eigen::Vector4d setpoint_;
  double ahead_s_ = 0;  ///< of the last physics step
};

}  // namespace lapservo::internal
