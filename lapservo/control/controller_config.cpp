#include "lapservo/control/controller_config.h"

#include <cmath>
#include <numbers>
#include <string>

#include <fmt/format.h>

#include "lapservo/control/delay_estimator.h"
#include "lapservo/control/motion_limits.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/error.h"
#include "lapservo/core/joint_units.h"
#include "lapservo/core/words.h"

namespace lapservo {
using namespace internal;
namespace {

void require(bool good, const std::string& field, double value, const char* expected) {
  if (!good) throw InputError("controller", field, std::to_string(value), expected);
}

void require_positive(const std::string& field, double value) {
  require(std::isfinite(value) && value > 0, field, value, "a number above 0");
}

std::string element(const char* field, int i) {
  return std::string(field) + "[" + std::to_string(i) + "]";
}

void require_positive(const char* field, const Eigen::Vector4d& values) {
  for (int i = 0; i < 4; ++i) require_positive(element(field, i), values[i]);
}

void require_not_negative(const std::string& field, double value, const char* expected = "0 or more") {
  require(std::isfinite(value) && value >= 0, field, value, expected);
}

void check_gains(const ControllerConfig& config) {
  for (int i = 0; i < 4; ++i) {
    const double gain = config.gains.per_s[i];
    require_not_negative(element("gains_per_s", i), gain, "0 or more per second");
    require(gain * config.period_s < 1, element("gains_per_s", i), gain, "less than one per control period");
  }
}

// Eq. (21) takes the late image for the present: its errors decay without a swing where gain x delay is below 1/e, and
// swing for ever beyond pi/2.
void check_late_image(const ControllerConfig& config) {
  if (config.mode != ControlMode::paper) return;
  const double delay_s = config.observer.delay_s.value_or(config.observer.initial_delay_s);
  const double most_per_s = 1 / (std::numbers::e * delay_s);
  for (int i = 0; i < 4; ++i) {
    const double gain = config.gains.per_s[i];
    if (!(gain >= most_per_s)) continue;
    throw InputError("controller", element("gains_per_s", i), std::to_string(gain),
                     fmt::format("at most {:.2f} per second: mode paper takes images that are {:.3f} s late for the "
                                 "present, and overshoots where gain x delay is above 1/e. Lower the gain, or give "
                                 "delay_s if it is less",
                                 std::floor(100 * most_per_s) / 100, delay_s));
  }
}

void require_plausible(const char* field, const Eigen::Vector4d& values, const JointUnits& units) {
  require_positive(field, values);
  if (const auto found = find_implausible({values[0], values[1], values[2], values[3]}, units)) {
    const int i = static_cast<int>(found->number);
    throw InputError("controller", element(field, i), std::to_string(values[i]), found->expected);
  }
}

void check_limits(const JointLimits& limits, double period_s) {
  require_plausible("limits.rate", limits.rate, joint_rates);
  require_plausible("limits.acceleration", limits.acceleration, joint_accelerations);
  for (int i = 0; i < 4; ++i) {
    require(std::isfinite(limits.lower[i]), element("limits.lower", i), limits.lower[i], "a finite number");
    require(std::isfinite(limits.upper[i]) && limits.upper[i] > limits.lower[i], element("limits.upper", i),
            limits.upper[i], "a number above the lower limit");
  }
  // An offset between an arm's joints and q moves a range, which keeps its width.
  require_plausible("(limits.upper - limits.lower) / 2", (limits.upper - limits.lower) / 2, joint_positions);
  require(period_s <= 2 * stopping_time_s(limits), "period_s", period_s,
          "at most twice the joints' stopping time, rate / acceleration: lower acceleration along with rate");
}

void check_window(const ImageWindow& window) {
  require(window.u_max_px > window.u_min_px, "window.u_max_px", window.u_max_px, "a number above u_min_px");
  require(window.v_max_px > window.v_min_px, "window.v_max_px", window.v_max_px, "a number above v_min_px");
}

void check_observer(const ObserverConfig& observer) {
  const auto check_delay = [](const std::string& field, double delay_s) {
    require(delay_s >= 0 && delay_s <= DelayEstimator::longest_s, field, delay_s, "0 to 0.3 seconds");
  };
  if (observer.delay_s) check_delay("delay_s", *observer.delay_s);
  check_delay("observer.initial_delay_s", observer.initial_delay_s);
  require_positive("observer.bandwidth_rad_s", observer.bandwidth_rad_s);
  require_positive("observer.offset_walk", observer.offset_walk);
  require_positive("observer.max_offset", observer.max_offset);
  require_not_negative("observer.offset_per_motion", observer.offset_per_motion);
  require_positive("observer.gate_chi2", observer.gate_chi2);
  require(observer.reacquire_after >= 1, "observer.reacquire_after", observer.reacquire_after, "1 or more");
  for (int i = 0; i < 4; ++i)
    require_not_negative(element("observer.backlash.largest", i), observer.backlash.largest[i]);
}

void check_learning(const ControllerConfig& config) {
  require_positive("jacobian.noise", config.jacobian.noise);
  require_positive("jacobian.bend", config.jacobian.bend);
  require_positive("jacobian.gate_chi2", config.jacobian.gate_chi2);
  require_not_negative("jacobian.walk", config.jacobian.walk);
  require_not_negative("jacobian.slack", config.jacobian.slack);
  require(config.jacobian.reacquire_after >= 1, "jacobian.reacquire_after", config.jacobian.reacquire_after,
          "1 or more");
  require_positive("probing.distance", config.probing.distance);
  require_positive("probing.joint_time_s", config.probing.joint_time_s);
}

constexpr Words<ControlMode, 4> mode_words{{{ControlMode::fused, "fused"},
                                            {ControlMode::fused, "default"},
                                            {ControlMode::paper, "paper"},
                                            {ControlMode::uncalibrated, "uncalibrated"}}};
static_assert(names_all(mode_words, ControlMode::uncalibrated));

}  // namespace

std::string_view to_string(ControlMode mode) {
  return word_of(mode_words, mode);
}

std::optional<ControlMode> control_mode_from_string(std::string_view word) {
  return read_word(mode_words, word);
}

JointLimits both_limits(const JointLimits& a, const JointLimits& b) {
  return {a.lower.cwiseMax(b.lower), a.upper.cwiseMin(b.upper), a.rate.cwiseMin(b.rate),
          a.acceleration.cwiseMin(b.acceleration)};
}

ControllerConfig paper_controller(double period_s) {
  ControllerConfig config;
  config.mode = ControlMode::paper;
  config.period_s = period_s;
  config.gains = paper_gains(period_s);
  return config;
}

ControllerConfig checked(const ControllerConfig& config) {
  require_positive("period_s", config.period_s);
  check_gains(config);
  check_limits(config.limits, config.period_s);
  if (config.window) check_window(*config.window);
  require_positive("scales.features", config.scales.features);
  require_positive("scales.joints", config.scales.joints);
  check_observer(config.observer);
  check_late_image(config);
  check_learning(config);
  require_positive("damping_threshold", config.damping_threshold);
  require_not_negative("min_singular_value", config.min_singular_value);
  require_positive("stale_after_s", config.stale_after_s);
  require_positive("max_image_age_s", config.max_image_age_s);
  require_positive("max_following_error", config.max_following_error);
  require_positive("model_error", config.model_error);
  return config;
}

}  // namespace lapservo
