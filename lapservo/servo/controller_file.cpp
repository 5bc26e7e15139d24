#include "lapservo/servo/controller_file.h"

#include <initializer_list>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "lapservo/control/tracking_law.h"
#include "lapservo/core/joint_units.h"
#include "lapservo/core/known_keys.h"
#include "lapservo/core/yaml_field.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo {
using namespace internal;
namespace {

JointLimits read_limits(const YamlField& map, JointLimits limits) {
  const auto read = [&](const char* key, Eigen::Vector4d& values, const JointUnits& units) {
    const YamlField field = map[key];
    if (!field.present()) return;
    const auto numbers = field.numbers<4>("a list of four numbers");
    expect_radians_and_metres(field, numbers, units);
    values = Eigen::Vector4d(numbers.data());
  };
  read("lower", limits.lower, joint_positions);
  read("upper", limits.upper, joint_positions);
  read("rate", limits.rate, joint_rates);
  read("acceleration", limits.acceleration, joint_accelerations);
  expect_keys(map, {{"lower", "upper", "rate", "acceleration"}, {}});
  return limits;
}

ImageWindow read_window(const YamlField& map, ImageWindow window) {
  for (const auto& [key, value] :
       std::initializer_list<std::pair<const char*, double*>>{{"u_min_px", &window.u_min_px},
                                                              {"u_max_px", &window.u_max_px},
                                                              {"v_min_px", &window.v_min_px},
                                                              {"v_max_px", &window.v_max_px}})
    if (const YamlField field = map[key]; field.present()) *value = field.number("a finite number");
  expect_keys(map, {{"u_min_px", "u_max_px", "v_min_px", "v_max_px"}, {}});
  return window;
}

ControlMode read_mode(const YamlField& field) {
  constexpr auto expected = "default, paper or uncalibrated";
  const auto mode = control_mode_from_string(field.text(expected));
  if (!mode) field.fail(field.value_text(), expected);
  return *mode;
}

// Without a value it is to be estimated.
std::optional<double> read_delay(const YamlField& field) {
  constexpr auto expected = "a finite number or estimate";
  if (field.text(expected) == "estimate") return {};
  return field.number(expected);
}

TrackingGains usual_gains(ControlMode mode, double period_s) {
  return mode == ControlMode::paper ? paper_gains(period_s) : TrackingGains();
}

std::string list_of(const Eigen::Vector4d& v) {
  return fmt::format("[{}, {}, {}, {}]", yaml_number(v[0]), yaml_number(v[1]), yaml_number(v[2]), yaml_number(v[3]));
}

}  // namespace

ControllerConfig load_controller(const std::filesystem::path& path, const ControllerConfig& base) {
  ControllerConfig config = base;
  const YamlField file = YamlField::read(path, "controller file");
  if (!file.is_map()) file.fail(file.value_text(), "a map of the controller's keys");
  expect_keys(file, {{"mode", "period_s", "gains_per_s", "delay_s", "model_error", "limits", "window"}, {}});
  if (const YamlField mode = file["mode"]; mode.present()) config.mode = read_mode(mode);
  if (const YamlField period = file["period_s"]; period.present()) config.period_s = period.number("a finite number");
  if (base.gains.per_s == usual_gains(base.mode, base.period_s).per_s)
    config.gains = usual_gains(config.mode, config.period_s);
  if (const YamlField gains = file["gains_per_s"]; gains.present())
    config.gains.per_s = Eigen::Vector4d(gains.numbers<4>("a list of four numbers").data());
  if (const YamlField delay = file["delay_s"]; delay.present()) config.observer.delay_s = read_delay(delay);
  if (const YamlField error = file["model_error"]; error.present())
    config.model_error = error.number("a number above 0");
  if (const YamlField limits = file["limits"]; limits.present()) config.limits = read_limits(limits, config.limits);
  if (const YamlField window = file["window"]; window.present())
    config.window = read_window(window, config.window.value_or(ImageWindow{}));
  return config;
}

ControllerConfig controller_for_arm(ControllerConfig base, const std::optional<std::filesystem::path>& file,
                                    const std::optional<JointLimits>& arm_limits) {
  if (arm_limits) base.limits = *arm_limits;
  ControllerConfig config = file ? load_controller(*file, base) : std::move(base);
  if (arm_limits) config.limits = both_limits(config.limits, *arm_limits);
  return checked(config);
}

std::string controller_yaml(const ControllerConfig& config) {
  std::string text = fmt::format("mode: {}\nperiod_s: {}\ngains_per_s: {}\ndelay_s: {}\nmodel_error: {}\n",
                                 to_string(config.mode), yaml_number(config.period_s), list_of(config.gains.per_s),
                                 config.observer.delay_s ? yaml_number(*config.observer.delay_s) : "estimate",
                                 yaml_number(config.model_error));
  text +=
      fmt::format("limits:\n  lower: {}\n  upper: {}\n  rate: {}\n  acceleration: {}\n", list_of(config.limits.lower),
                  list_of(config.limits.upper), list_of(config.limits.rate), list_of(config.limits.acceleration));
  if (config.window)
    text += fmt::format("window: {{u_min_px: {}, u_max_px: {}, v_min_px: {}, v_max_px: {}}}\n",
                        yaml_number(config.window->u_min_px), yaml_number(config.window->u_max_px),
                        yaml_number(config.window->v_min_px), yaml_number(config.window->v_max_px));
  return text;
}

}  // namespace lapservo
