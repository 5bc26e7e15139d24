#pragma once

#include <Eigen/Core>

namespace lapservo {

/// An arm of the simulator: pivots at its RCM and takes joint positions (CRTK servo_jp). Joints: theta_rad, phi_rad,
/// rho_m, psi_rad. Time is simulated.
class SimulatedArm {
 public:
  virtual ~SimulatedArm() = default;

  /// Goes there from now on. Beyond the limits it goes to the limit; a value that isn't finite is a fault: the arm
  /// stops and stays until recover().
  virtual void servo_jp(const Eigen::Vector4d& setpoint) = 0;
  virtual void step(double dt_s) = 0;

  /// The encoders' readings: the motors' positions, rounded.
  virtual Eigen::Vector4d measured_jp() const = 0;
  /// Where the instrument is.
  virtual Eigen::Vector4d true_jp() const = 0;

  virtual bool faulted() const = 0;
  virtual void fault() = 0;
  virtual void recover() = 0;
};

}  // namespace lapservo
