#include "lapservo/sim/arm.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lapservo/core/error.h"

namespace lapservo {
namespace {

// Solution of x' = clamp((setpoint - x) / lag, -rate, rate): at full speed while farther than rate * lag, then
// exponentially.
double approach(double x, double setpoint, double rate, double lag_s, double dt_s) {
  const double away = setpoint - x, near = rate * lag_s;
  const double full_speed_s = std::min(dt_s, std::max(0.0, (std::abs(away) - near) / rate));
  const double after = x + std::copysign(rate * full_speed_s, away);
  const double left_s = dt_s - full_speed_s;
  if (!(left_s > 0)) return after;
  return setpoint - (lag_s > 0 ? (setpoint - after) * std::exp(-left_s / lag_s) : 0.0);
}

void check(bool right, const char* field, const Eigen::Ref<const Eigen::VectorXd>& value, const char* expected) {
  if (!right)
    throw InputError("arm", field, fmt::format("{}", fmt::join(value.data(), value.data() + value.size(), " ")),
                     expected);
}

}  // namespace

const ArmConfig& ArmConfig::checked() const {
  check(lower.allFinite() && upper.allFinite() && (lower.array() < upper.array()).all(), "lower", lower,
        "finite and below upper");
  check(rate.allFinite() && (rate.array() > 0).all(), "rate", rate, "above 0");
  check(std::isfinite(lag_s) && lag_s >= 0, "lag_s", Eigen::VectorXd::Constant(1, lag_s), "0 or more");
  check(resolution.allFinite() && (resolution.array() >= 0).all(), "resolution", resolution, "0 or more");
  check(backlash.allFinite() && (backlash.array() >= 0).all(), "backlash", backlash, "0 or more");
  check(joint_offset.allFinite(), "joint_offset", joint_offset, "finite");
  check(rcm_offset_m.allFinite(), "rcm_offset_m", rcm_offset_m, "finite");
  return *this;
}

Arm::Arm(const ArmConfig& config, const Eigen::Vector4d& q_measured)
    : config_(config.checked()), setpoint_(q_measured), motor_(q_measured), q_driven_(q_measured) {
  check(q_measured.allFinite() && (q_measured.array() >= config.lower.array()).all() &&
            (q_measured.array() <= config.upper.array()).all(),
        "start", q_measured, "within lower and upper");
}

void Arm::servo_jp(const Eigen::Vector4d& setpoint) {
  if (!setpoint.allFinite()) fault();
  if (faulted_) return;
  setpoint_ = setpoint.cwiseMax(config_.lower).cwiseMin(config_.upper);
}

void Arm::step(double dt_s) {
  for (int i = 0; i < 4; ++i) motor_[i] = approach(motor_[i], setpoint_[i], config_.rate[i], config_.lag_s, dt_s);
  q_driven_ = q_driven_.cwiseMax(motor_ - config_.backlash / 2).cwiseMin(motor_ + config_.backlash / 2);
}

Eigen::Vector4d Arm::measured_jp() const {
  Eigen::Vector4d measured = motor_;
  for (int i = 0; i < 4; ++i)
    if (config_.resolution[i] > 0) measured[i] = std::round(motor_[i] / config_.resolution[i]) * config_.resolution[i];
  return measured;
}

void Arm::fault() {
  faulted_ = true;
  setpoint_ = motor_;
}

void Arm::recover() {
  faulted_ = false;
}

}  // namespace lapservo
