#include "lapservo/rig/rig_updater.h"

#include <limits>
#include <system_error>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "lapservo/core/error.h"
#include "lapservo/core/input_file.h"
#include "lapservo/core/rounded_sigma.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

std::string camera_path_from(const std::string& camera, const fs::path& rig, const fs::path& destination) {
  if (fs::path(camera).is_absolute()) return camera;
  std::error_code error;
  const fs::path folder = fs::absolute(destination, error).parent_path();
  const fs::path file = fs::absolute(rig, error).parent_path() / camera;
  if (folder == fs::absolute(rig, error).parent_path()) return camera;
  const fs::path relative = fs::relative(file, folder, error);
  return relative.empty() ? file.lexically_normal().string() : relative.string();
}

std::string text_of(const YAML::Node& root) {
  YAML::Emitter out;
  out << root;
  return std::string(out.c_str()) + "\n";
}

// Wherever it stands.
YAML::Node camera_of(const YAML::Node& root, const fs::path& path) {
  const YAML::Node camera = root["camera"];
  return camera.IsScalar() ? YAML::LoadFile((path.parent_path() / camera.Scalar()).string()) : camera;
}

// A file's content with one instrument's entry edited.
template <typename Edit>
std::string edited(YAML::Node root, const fs::path& path, const fs::path& destination, std::size_t instrument,
                   Edit edit) {
  if (YAML::Node camera = root["camera"]; camera.IsScalar())
    root["camera"] = camera_path_from(camera.Scalar(), path, destination);
  edit(root["instruments"][instrument]);
  return text_of(root);
}

template <typename Edit>
std::string with_instrument(const RigText& rig, const fs::path& destination, std::size_t instrument, Edit edit) {
  return edited(YAML::Load(rig.yaml), rig.path, destination, instrument, edit);
}

// As short as reads back to the same bits.
std::string exact(double value) {
  return fmt::format("{}", value);
}
// To a hundredth of a degree.
std::string rounded_hue(double value) {
  return fmt::format("{:.2f}", value);
}

template <typename Numbers, typename Text>
YAML::Node list_of(const Numbers& numbers, Text text) {
  YAML::Node list;
  list.SetStyle(YAML::EmitterStyle::Flow);
  for (const double number : numbers) list.push_back(text(number));
  return list;
}

}  // namespace

RigText RigText::read(const fs::path& path) {
  constexpr std::size_t max_bytes = std::size_t{16} << 20;
  return {read_input(path, max_bytes, "a YAML file"), path};
}

Rig RigText::rig() const {
  if (yaml.empty()) throw InputError(path.string(), "is empty, expected a YAML file");
  return parse_rig(yaml, path.string(), path.parent_path());
}

std::string moved_rig_yaml(const RigText& rig, const fs::path& destination) {
  YAML::Node root = YAML::Load(rig.yaml);
  YAML::Node camera = root["camera"];
  if (!camera.IsScalar()) return rig.yaml;
  const std::string moved = camera_path_from(camera.Scalar(), rig.path, destination);
  if (moved == camera.Scalar()) return rig.yaml;
  root["camera"] = moved;
  return text_of(root);
}

std::string updated_rig_yaml(const RigText& rig, const fs::path& destination, std::size_t instrument,
                             const Marker& marker) {
  return with_instrument(rig, destination, instrument, [&](YAML::Node entry) {
    YAML::Node old = entry["marker"];
    const YAML::Node numbers = YAML::Load(marker_yaml(marker, 0));
    for (const auto& number : numbers) old[number.first.Scalar()] = number.second;
    for (const char* key : {"wrap_m", "skew_m", "gap_rad", "tolerance_m"})
      if (!numbers[key]) old.remove(key);
  });
}

std::string updated_rig_yaml(const RigText& rig, const fs::path& destination, std::size_t instrument,
                             const MeasuredRegistration& measured) {
  return with_instrument(rig, destination, instrument, [&](YAML::Node entry) {
    YAML::Node transform;
    transform["translation_m"] = list_of(measured.camera_from_rcm.translation, exact);
    transform["sigma_translation_m"] = list_of(measured.sigma_translation_m, sigma_text);
    transform["quaternion_xyzw"] = list_of(measured.camera_from_rcm.rotation.coeffs(), exact);
    if (measured.sigma_quaternion_xyzw)
      transform["sigma_quaternion_xyzw"] = list_of(*measured.sigma_quaternion_xyzw, sigma_text);
    entry["camera_from_rcm"] = transform;
    if (measured.joints) {
      YAML::Node joints;
      joints["names"].SetStyle(YAML::EmitterStyle::Flow);
      for (const std::string& name : measured.joints->names) joints["names"].push_back(name);
      joints["sign"] = list_of(measured.joints->sign, exact);
      joints["offset"] = list_of(measured.joints->offset, exact);
      joints["sigma_offset"] = list_of(measured.sigma_offset, sigma_text);
      entry["joints"] = joints;
    }
    if (measured.image_delay_s) {
      entry["image_delay_s"] = exact(*measured.image_delay_s);
      entry["sigma_image_delay_s"] = sigma_text(measured.sigma_image_delay_s);
    }
  });
}

std::string updated_rig_yaml(const RigText& rig, const fs::path& destination, std::size_t instrument,
                             const MeasuredColour& colour) {
  YAML::Node root = YAML::Load(rig.yaml);
  if (colour.response) {
    YAML::Node camera = camera_of(root, rig.path);
    root["camera"] = camera;
    camera["response"] = YAML::Load(response_yaml(*colour.response));
    camera.remove("sigma_response");
  }
  const auto with_colour = [&](YAML::Node entry) {
    YAML::Node marker = entry["marker"];
    marker["hues_deg"] = list_of(colour.hues_deg, rounded_hue);
    marker["sigma_hues_deg"] = list_of(colour.sigma_hues_deg, sigma_text);
  };
  return edited(root, rig.path, destination, instrument, with_colour);
}

bool is_response_measured(const RigText& rig) {
  return sigma_of_response(rig).has_value();
}

std::optional<double> sigma_of_response(const RigText& rig) {
  const YAML::Node sigma = camera_of(YAML::Load(rig.yaml), rig.path)["sigma_response"];
  if (!sigma.IsDefined()) return std::nullopt;
  const double value = sigma.as<double>(std::numeric_limits<double>::quiet_NaN());
  return value == 0 ? std::nullopt : std::optional(value);
}

std::string measured_camera_yaml(const RigText& rig, const Camera& camera, CameraSigmas sigmas) {
  if (sigmas.response == 0) sigmas.response = sigma_of_response(rig).value_or(0);
  return measured_camera_yaml(camera, sigmas);
}

std::string updated_rig_yaml(const RigText& rig, const Camera& camera, const CameraSigmas& sigmas) {
  YAML::Node root = YAML::Load(rig.yaml);
  root["camera"] = YAML::Load(measured_camera_yaml(rig, camera, sigmas));
  return text_of(root);
}

}  // namespace lapservo::internal
