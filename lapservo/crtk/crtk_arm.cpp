#include "lapservo/crtk/crtk_arm.h"

#include <cmath>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/interlock.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/robot/operating_state.h"

namespace lapservo::internal {

CrtkArm::CrtkArm(Transport& transport, const std::string& arm, std::vector<std::string> names)
    : transport_(transport),
      names_(std::move(names)),
      measured_js_(transport.publisher<JointMessage>(topic_of(arm, "measured_js"))),
      setpoint_js_(transport.publisher<JointMessage>(topic_of(arm, "setpoint_js"))),
      operating_state_(transport.publisher<OperatingStateMessage>(topic_of(arm, "operating_state"))) {
  subscriptions_.push_back(transport.subscribe<JointMessage>(
      topic_of(arm, "servo_jp"), [this](JointMessage&& message) { take(std::move(message)); }));
  subscriptions_.push_back(
      transport.subscribe<StringMessage>(topic_of(arm, "state_command"), [this](StringMessage&& command) {
        const std::lock_guard lock(mutex_);
        commands_.push_back(std::move(command.text));
      }));
}

void CrtkArm::take(JointMessage&& message) {
  const bool is_whole = message.positions.size() == names_.size() &&
                        (message.names.empty() || message.names == names_) && all_finite(message.positions);
  const std::lock_guard lock(mutex_);
  if (!is_whole) {
    ++malformed_;
  } else if (obeys_) {
    setpoint_ = std::move(message.positions);
    arrival_s_ = transport_.stamp_now_s();
  }
}

JointMessage CrtkArm::joints(std::vector<double> positions) const {
  if (positions.size() != names_.size())
    throw InputError("joints",
                     fmt::format("are {}, expected one for each of {} names", positions.size(), names_.size()));
  return {transport_.stamp_now_s(), names_, std::move(positions)};
}

void CrtkArm::say_joints(const JointMessage& measured, const JointMessage& setpoint) {
  measured_js_(measured);
  setpoint_js_(setpoint);
}

void CrtkArm::say_state(OperatingStateMessage state) {
  constexpr double period_s = 0.5;
  {
    const std::lock_guard lock(mutex_);
    obeys_ = state.state == to_string(OperatingState::enabled) && state.is_homed && !state.is_busy;
    if (!obeys_) setpoint_.reset();
  }
  state.stamp_s = transport_.stamp_now_s();
  if (said_ && state.state == said_->state && state.is_homed == said_->is_homed && state.is_busy == said_->is_busy &&
      std::abs(state.stamp_s - said_->stamp_s) < period_s)
    return;
  operating_state_(state);
  said_ = std::move(state);
}

std::optional<std::vector<double>> CrtkArm::new_setpoint() {
  const std::lock_guard lock(mutex_);
  if (std::abs(transport_.stamp_now_s() - arrival_s_) > lost_s) setpoint_.reset();
  return std::exchange(setpoint_, std::nullopt);
}

std::vector<std::string> CrtkArm::new_commands() {
  const std::lock_guard lock(mutex_);
  return std::exchange(commands_, {});
}

long CrtkArm::malformed() const {
  const std::lock_guard lock(mutex_);
  return malformed_;
}

}  // namespace lapservo::internal
