#include "lapservo/servo/controller_file.h"

#include <array>
#include <cmath>
#include <string_view>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"

namespace lapservo {
namespace {

class Reader {
 public:
  explicit Reader(std::string source) : source_(std::move(source)) {}

  [[noreturn]] void complain(const std::string& field, const YAML::Node& value, const std::string& expected) const {
    throw InputError(source_, field, value.IsScalar() ? value.Scalar() : "a list or map", expected);
  }
  double number(const std::string& field, const YAML::Node& node) const {
    const auto value = node.IsScalar() ? parse_finite(node.Scalar()) : std::nullopt;
    if (!value) complain(field, node, "a finite number");
    return *value;
  }
  Eigen::Vector4d four(const std::string& field, const YAML::Node& node) const {
    if (!node.IsSequence() || node.size() != 4) complain(field, node, "a list of four numbers");
    Eigen::Vector4d values;
    for (std::size_t i = 0; i < 4; ++i)
      values[static_cast<Eigen::Index>(i)] = number(fmt::format("{}[{}]", field, i), node[i]);
    return values;
  }
  template <class Take>
  void each(const std::string& field, const YAML::Node& map, const Take& take) const {
    if (!map.IsMap()) complain(field, map, "a map");
    for (const auto& entry : map) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "?";
      const std::string name = field.empty() ? key : field + "." + key;
      if (!take(key, name, entry.second)) throw InputError(source_, name, "unknown", "a key that the controller knows");
    }
  }

 private:
  std::string source_;
};

void read_limits(const Reader& reader, const YAML::Node& node, JointLimits& limits) {
  reader.each("limits", node, [&](const std::string& key, const std::string& name, const YAML::Node& value) {
    for (const auto& [word, target] : {std::pair<std::string_view, Eigen::Vector4d*>{"lower", &limits.lower},
                                       {"upper", &limits.upper},
                                       {"rate", &limits.rate},
                                       {"acceleration", &limits.acceleration}})
      if (key == word) return *target = reader.four(name, value), true;
    return false;
  });
}

ImageWindow read_window(const Reader& reader, const YAML::Node& node, ImageWindow window) {
  reader.each("window", node, [&](const std::string& key, const std::string& name, const YAML::Node& value) {
    for (const auto& [word, target] : {std::pair<std::string_view, double*>{"u_min_px", &window.u_min_px},
                                       {"u_max_px", &window.u_max_px},
                                       {"v_min_px", &window.v_min_px},
                                       {"v_max_px", &window.v_max_px}})
      if (key == word) return *target = reader.number(name, value), true;
    return false;
  });
  return window;
}

bool read_key(const Reader& reader, const std::string& key, const YAML::Node& value, ControllerConfig& config) {
  if (key == "mode") {
    const auto mode = value.IsScalar() ? mode_from_word(value.Scalar()) : std::nullopt;
    if (!mode) reader.complain(key, value, "default, paper or uncalibrated");
    config.mode = *mode;
  } else if (key == "period_s") {
    config.period_s = reader.number(key, value);
  } else if (key == "gains_per_s") {
    config.gains.per_s = reader.four(key, value);
  } else if (key == "delay_s") {
    if (value.IsScalar() && value.Scalar() == "estimate")
      config.observer.delay_s.reset();
    else
      config.observer.delay_s = reader.number(key, value);
  } else if (key == "limits") {
    read_limits(reader, value, config.limits);
  } else if (key == "window") {
    config.window = read_window(reader, value, config.window.value_or(ImageWindow{}));
  } else {
    return false;
  }
  return true;
}

std::string list_of(const Eigen::Vector4d& v) {
  return fmt::format("[{}, {}, {}, {}]", v[0], v[1], v[2], v[3]);
}

}  // namespace

ControllerConfig load_controller(const std::filesystem::path& path, const ControllerConfig& base) {
  const Reader reader(path.string());
  ControllerConfig config = base;
  YAML::Node root;
  try {
    root = YAML::LoadFile(path.string());
  } catch (const YAML::BadFile&) {
    throw InputError(path.string(), "can't be read");
  } catch (const YAML::Exception& error) {
    throw InputError(path.string(), fmt::format("is not YAML: line {}: {}", error.mark.line + 1, error.msg));
  }
  if (!root.IsMap()) throw InputError(path.string(), "holds no keys, expected a controller's YAML");
  reader.each("", root, [&](const std::string& key, const std::string&, const YAML::Node& value) {
    return read_key(reader, key, value, config);
  });
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
