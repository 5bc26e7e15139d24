#include "lapservo/servo/servo.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "lapservo/control/delay_estimator.h"
#include "lapservo/control/motion_limits.h"
#include "lapservo/servo/image_features.h"

namespace lapservo::internal {
namespace {

// An arm that did not follow may go on after it has stood still for so long; by how much a joint may move in that time.
constexpr double at_rest_s = 0.5;
const Eigen::Vector4d at_rest(0.002, 0.002, 0.0003, 0.01);

constexpr int contradicted_after = 10;

std::string limit_text(const PositionLimit& limit, const ControllerConfig& config) {
  return PositionBounds(config.limits, config.window).text(limit);
}

std::string unanswered_text(const Unanswered& found, const std::array<std::string, 4>& names, ControlMode mode) {
  const std::string& name = names[static_cast<std::size_t>(found.joint)];
  constexpr double other_way = -0.5;
  if (found.slope < other_way && mode == ControlMode::uncalibrated)
    return fmt::format(
        "{} moves the image the other way than when that was learnt: run servo again where the camera "
        "was turned",
        name);
  if (found.slope < other_way)
    return fmt::format("the image moves the other way: joints.sign of {} is wrong, or it is another arm's camera",
                       name);
  return fmt::format(
      "the image does not follow {}: another arm's camera, a slipping instrument, a frozen image, or images that "
      "come more than 0.3 s late",
      name);
}

std::string remedy_of(const ControlStep& control, const std::array<std::string, 4>& names,
                      const ControllerConfig& config) {
  const ControlMode mode = config.mode;
  switch (control.reason) {
    case HoldReason::slow_images:
      return "at least 10 images a second are needed: check the camera's rate, its exposure and the network";
    case HoldReason::endoscope_moved:
      return "move the instrument, by hand or teleoperation, until endoscope_measured";
    case HoldReason::endoscope_measured:
      return "say start to continue";
    case HoldReason::image_not_following:
      return control.unanswered ? unanswered_text(*control.unanswered, names, mode) : "";
    case HoldReason::error_grows: {
      const std::string check = mode == ControlMode::uncalibrated
                                    ? "run servo again, which learns the image's motion anew"
                                    : "check joints.sign, camera_from_rcm and whose image it is";
      if (!control.stops_at) return "the arm moves away from its goal: " + check;
      return limit_text(*control.stops_at, config) +
             " keeps the arm from its goal, and its way along that limit leads away: give another goal, then say "
             "start. Where the goal needs no such place, " +
             check;
    }
    case HoldReason::delay_not_found:
      return "images and joints agree at no delay up to 0.3 s: check whose image it is, or give delay_s";
    case HoldReason::tip_open:
      return "the tool, bent as it is, leaves the tip open by more than 3 mm: straighten the wrist, or measure the "
             "tool by lapservo calibrate tip --touch with a bent wrist";
    case HoldReason::tip_unreachable:
      return "the shaft can't hold the tip at its goal with the wrist as it is: straighten the wrist, or give another "
             "goal";
    case HoldReason::goal_beyond_limit:
      return control.stops_at
                 ? limit_text(*control.stops_at, config) + " keeps the arm from its goal: give another goal"
                 : "";
    default:
      return "";
  }
}

bool orderly(const ControlStep& control) {
  return control.has_setpoint && control.setpoint.position.allFinite() && control.setpoint.velocity.allFinite();
}

// The delay that a calibration measured is where its estimate begins.
ControllerConfig with_delay_of(const Instrument& instrument, ControllerConfig config) {
  constexpr double earliest_s = -0.02;  // noise of one that is 0
  const double delay_s = instrument.image_delay_s.value_or(-1);
  if (delay_s >= earliest_s && delay_s <= DelayEstimator::longest_s)
    config.observer.initial_delay_s = std::max(0.0, delay_s);
  return config;
}

}  // namespace

Servo::Servo(const ControllerConfig& config, FeatureModel model)
    : controller_(config, model), registered_(model != nullptr) {}

Servo::Servo(const ControllerConfig& config, const Rig& rig)
    : Servo(with_delay_of(rig.instruments.front(), config), feature_model(rig)) {
  if (rig.instruments.front().joints) names_ = rig.instruments.front().joints->names;
  camera_from_rcm_ = rig.instruments.front().camera_from_rcm;
  if (config.mode == ControlMode::fused) recovery_.emplace(rig);
}

ServoDecision Servo::step(const ServoInput& input) {
  if (!recovery_) return decide(input);
  ServoInput counted = input;
  if (input.image && input.image->registration != recovery_->registration()) counted.image.reset();
  recovery_->see(counted, controller_);
  ServoDecision decision = decide(counted);
  recovery_->follow(counted, decision.control, controller_);
  decision.registration = recovery_->registration();
  decision.camera_from_rcm = recovery_->camera_from_rcm();
  if (decision.registration > 0) decision.registration_covariance = recovery_->instrument().registration_covariance;
  if (const auto why = recovery_->wrong_rig()) decision.remedy = why->text(recovery_->instrument());
  return decision;
}

ServoDecision Servo::decide(const ServoInput& input) {
  const Eigen::Vector4d q = input.joints.q.vector();
  ServoDecision decision;
  decision.camera_from_rcm = camera_from_rcm_;
  controller_.expect_following(input.joints.follows);
  const bool enabled = input.joints.operating_state == OperatingState::enabled;
  if (!std::exchange(enabled_, enabled) && enabled) controller_.need_image_since(input.time_s), begins_ = true;
  if (input.joints.started) controller_.restart_tests();
  decision.control = controller_.step(input.time_s, q, input.image, input.desired, input.readings);
  if (recovery_) recovery_->doubt(decision.control.reason, controller_);
  // A marker that is hidden in part may be seen without q for a few images; a wrong registration is there in all.
  if (registered_ && input.image && input.image->found)
    images_contradicting_ = input.image->q ? 0 : std::min(images_contradicting_ + 1, contradicted_after);
  decision.registration_contradicted = images_contradicting_ >= contradicted_after;
  // The reading before may have been a wild one, from which nothing is to be sent.
  if (begins_ && controller_.has_measured()) {
    begins_ = false;
    controller_.reset(input.time_s, q);
    decision.control.setpoint = controller_.path().end();
  }
  decision.send = orderly(decision.control) && !begins_;
  start_anew_when_at_rest(input, decision.control.reason);
  decision.release = recovery_ && recovery_->moved();
  decision.remedy = remedy_of(decision.control, names_, controller_.config());
  if (enabled && !decision.release) return decision;
  decision.control.action = ControlAction::hold;
  if (!decision.release) decision.control.reason = HoldReason::arm_not_enabled, decision.remedy.clear();
  decision.send = false;
  // Setpoints stay where the arm is, so that nothing jumps when it is to move again.
  if (std::isfinite(input.time_s) && q.allFinite()) controller_.reset(input.time_s, q);
  return decision;
}

void Servo::start_anew_when_at_rest(const ServoInput& input, HoldReason reason) {
  if (reason != HoldReason::not_following) {
    not_following_since_s_.reset();
    return;
  }
  const Eigen::Vector4d q = input.joints.q.vector();
  const bool moved = ((q - q_then_).cwiseAbs().array() > at_rest.array()).any();
  if (!not_following_since_s_ || moved) {
    not_following_since_s_ = input.time_s;
    q_then_ = q;
  } else if (input.time_s - *not_following_since_s_ > at_rest_s) {
    controller_.start_over(input.time_s, q);
    not_following_since_s_.reset();
  }
}

}  // namespace lapservo::internal
