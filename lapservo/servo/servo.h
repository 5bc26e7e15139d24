#pragma once

#include <array>
#include <optional>
#include <string>

#include "lapservo/control/visual_controller.h"
#include "lapservo/rig/rig.h"
#include "lapservo/servo/endoscope_recovery.h"
#include "lapservo/servo/servo_decision.h"

namespace lapservo::internal {

/// The loop's one step, the same for a real arm, a simulated one and a replay: it goes by nothing but its inputs.
class Servo {
 public:
  /// Throws InputError for a configuration that can't work.
  Servo(const ControllerConfig& config, FeatureModel model);
  /// The servo of the rig's first instrument. With ControlMode::fused and where the rig has camera_from_rcm, the arm is
  /// held when the endoscope moved (EndoscopeRecovery).
  Servo(const ControllerConfig& config, const Rig& rig);

  ServoDecision step(const ServoInput& input);

  /// The setpoints from the latest step on.
  const JointPath& path() const { return controller_.path(); }
  const VisualController& controller() const { return controller_; }

 private:
  ServoDecision decide(const ServoInput& input);
  void start_anew_when_at_rest(const ServoInput& input, HoldReason reason);

  VisualController controller_;
  std::array<std::string, 4> names_{"theta", "phi", "rho", "psi"};  ///< of the joints
  std::optional<Rigid3> camera_from_rcm_;                           ///< the rig's
  std::optional<EndoscopeRecovery> recovery_;
  bool enabled_ = false;          ///< in the step before
  bool begins_ = false;           ///< enabled, but no joints have come since that an arm can have
  bool registered_;               ///< the rig says where the RCM is
  int images_contradicting_ = 0;  ///< in a row
  std::optional<double> not_following_since_s_;
  Eigen::Vector4d q_then_ = Eigen::Vector4d::Zero();
};

}  // namespace lapservo::internal
