#include "lapservo/servo/servo.h"

#include <cmath>
#include <utility>

namespace lapservo {
namespace {

// An arm that did not follow may go on after it has stood still for so long; by how much a joint may move in that time.
constexpr double at_rest_s = 0.5;
const Eigen::Vector4d at_rest(0.002, 0.002, 0.0003, 0.01);

bool orderly(const ControlStep& control) {
  return control.has_setpoint && control.setpoint.position.allFinite() && control.setpoint.velocity.allFinite();
}

}  // namespace

Servo::Servo(const ControllerConfig& config, FeatureModel model) : controller_(config, std::move(model)) {}

ServoDecision Servo::step(const ServoInput& input) {
  ServoDecision decision;
  decision.control = controller_.step(input.time_s, input.arm.q_joint, input.image, input.desired);
  decision.reason = reason_word(decision.control.reason);
  decision.send = orderly(decision.control);
  if (input.arm.state != ArmState::enabled) {
    decision.control.action = ControlAction::hold;
    decision.reason = "arm_not_enabled";
    decision.send = false;
    // Setpoints stay where the arm is, so that nothing jumps when it is enabled again.
    if (std::isfinite(input.time_s) && input.arm.q_joint.allFinite())
      controller_.reset(input.time_s, input.arm.q_joint);
  }
  start_anew_when_at_rest(input, decision.control.reason);
  return decision;
}

void Servo::start_anew_when_at_rest(const ServoInput& input, HoldReason reason) {
  if (reason != HoldReason::not_following) {
    not_following_since_s_.reset();
    return;
  }
  const bool moved = ((input.arm.q_joint - q_then_).cwiseAbs().array() > at_rest.array()).any();
  if (!not_following_since_s_ || moved) {
    not_following_since_s_ = input.time_s;
    q_then_ = input.arm.q_joint;
  } else if (input.time_s - *not_following_since_s_ > at_rest_s) {
    controller_.reset(input.time_s, input.arm.q_joint);
    not_following_since_s_.reset();
  }
}

}  // namespace lapservo
