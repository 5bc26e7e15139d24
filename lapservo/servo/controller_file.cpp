#include "lapservo/servo/controller_file.h"

#include <optional>

#include <fmt/format.h>

#include "lapservo/rig/yaml_field.h"

namespace lapservo {
namespace {

[[noreturn]] void refuse_key(const YamlField& field) {
  field.fail("unknown", "a key that the controller knows");
}

Eigen::Vector4d four(const YamlField& field) {
  const auto values = field.numbers<4>("a list of four numbers");
  return Eigen::Vector4d(values.data());
}

JointLimits read_limits(const YamlField& map, JointLimits limits) {
  for (const auto& [key, value] : map.entries("a map")) {
    if (key == "lower")
      limits.lower = four(value);
    else if (key == "upper")
      limits.upper = four(value);
    else if (key == "rate")
      limits.rate = four(value);
    else if (key == "acceleration")
      limits.acceleration = four(value);
    else
      refuse_key(value);
  }
  return limits;
}

ImageWindow read_window(const YamlField& map, ImageWindow window) {
  constexpr auto expected = "a finite number";
  for (const auto& [key, value] : map.entries("a map")) {
    if (key == "u_min_px")
      window.u_min_px = value.number(expected);
    else if (key == "u_max_px")
      window.u_max_px = value.number(expected);
    else if (key == "v_min_px")
      window.v_min_px = value.number(expected);
    else if (key == "v_max_px")
      window.v_max_px = value.number(expected);
    else
      refuse_key(value);
  }
  return window;
}

ControlMode read_mode(const YamlField& field) {
  constexpr auto expected = "default, paper or uncalibrated";
  const auto mode = mode_from_word(field.text(expected));
  if (!mode) field.fail(field.value_text(), expected);
  return *mode;
}

// Without a value it is to be estimated.
std::optional<double> read_delay(const YamlField& field) {
  constexpr auto expected = "a finite number or estimate";
  if (field.text(expected) == "estimate") return {};
  return field.number(expected);
}

std::string list_of(const Eigen::Vector4d& v) {
  return fmt::format("[{}, {}, {}, {}]", v[0], v[1], v[2], v[3]);
}

}  // namespace

ControllerConfig load_controller(const std::filesystem::path& path, const ControllerConfig& base) {
  ControllerConfig config = base;
  for (const auto& [key, value] : YamlField::read(path, "controller file").entries("a map of the controller's keys")) {
    if (key == "mode")
      config.mode = read_mode(value);
    else if (key == "period_s")
      config.period_s = value.number("a finite number");
    else if (key == "gains_per_s")
      config.gains.per_s = four(value);
    else if (key == "delay_s")
      config.observer.delay_s = read_delay(value);
    else if (key == "limits")
      config.limits = read_limits(value, config.limits);
    else if (key == "window")
      config.window = read_window(value, config.window.value_or(ImageWindow{}));
    else
      refuse_key(value);
  }
  return config;
}

std::string controller_yaml(const ControllerConfig& config) {
  std::string text = fmt::format("mode: {}\nperiod_s: {}\ngains_per_s: {}\ndelay_s: {}\n", mode_word(config.mode),
                                 config.period_s, list_of(config.gains.per_s),
                                 config.observer.delay_s ? fmt::format("{}", *config.observer.delay_s) : "estimate");
  text +=
      fmt::format("limits:\n  lower: {}\n  upper: {}\n  rate: {}\n  acceleration: {}\n", list_of(config.limits.lower),
                  list_of(config.limits.upper), list_of(config.limits.rate), list_of(config.limits.acceleration));
  if (config.window)
    text += fmt::format("window: {{u_min_px: {}, u_max_px: {}, v_min_px: {}, v_max_px: {}}}\n", config.window->u_min_px,
                        config.window->u_max_px, config.window->v_min_px, config.window->v_max_px);
  return text;
}

}  // namespace lapservo
