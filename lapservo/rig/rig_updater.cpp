#include "lapservo/rig/rig_updater.h"

#include <system_error>

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include "lapservo/rig/rig_writer.h"

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

// The file with one instrument's entry edited.
template <typename Edit>
std::string with_instrument(const fs::path& path, const fs::path& destination, std::size_t instrument, Edit edit) {
  YAML::Node root = YAML::LoadFile(path.string());
  if (YAML::Node camera = root["camera"]; camera.IsScalar())
    root["camera"] = camera_path_from(camera.Scalar(), path, destination);
  edit(root["instruments"][instrument]);
  YAML::Emitter out;
  out << root;
  return std::string(out.c_str()) + "\n";
}

// As short as reads back to the same bits.
std::string text_of(double value) {
  return fmt::format("{}", value);
}
// Of a standard deviation.
std::string sigma_text_of(double value) {
  return fmt::format("{:.3g}", value);
}

template <typename Numbers, typename Text>
YAML::Node list_of(const Numbers& numbers, Text text) {
  YAML::Node list;
  list.SetStyle(YAML::EmitterStyle::Flow);
  for (const double number : numbers) list.push_back(text(number));
  return list;
}

}  // namespace

std::string updated_rig_yaml(const fs::path& path, const fs::path& destination, std::size_t instrument,
                             const Marker& marker) {
  return with_instrument(path, destination, instrument, [&](YAML::Node entry) {
    YAML::Node old = entry["marker"];
    const YAML::Node numbers = YAML::Load(marker_yaml(marker, 0));
    for (const auto& number : numbers) old[number.first.Scalar()] = number.second;
    for (const char* key : {"wrap_m", "skew_m", "gap_rad", "tolerance_m"})
      if (!numbers[key]) old.remove(key);
  });
}

std::string updated_rig_yaml(const fs::path& path, const fs::path& destination, std::size_t instrument,
                             const MeasuredRegistration& measured) {
  return with_instrument(path, destination, instrument, [&](YAML::Node entry) {
    YAML::Node transform;
    transform["translation_m"] = list_of(measured.camera_from_rcm.translation, text_of);
    transform["sigma_translation_m"] = list_of(measured.sigma_translation_m, sigma_text_of);
    transform["quaternion_xyzw"] = list_of(measured.camera_from_rcm.rotation.coeffs(), text_of);
    if (measured.sigma_quaternion_xyzw)
      transform["sigma_quaternion_xyzw"] = list_of(*measured.sigma_quaternion_xyzw, sigma_text_of);
    entry["camera_from_rcm"] = transform;
    if (measured.joints) {
      YAML::Node joints;
      joints["names"].SetStyle(YAML::EmitterStyle::Flow);
      for (const std::string& name : measured.joints->names) joints["names"].push_back(name);
      joints["sign"] = list_of(measured.joints->sign, text_of);
      joints["offset"] = list_of(measured.joints->offset, text_of);
      joints["sigma_offset"] = list_of(measured.sigma_offset, sigma_text_of);
      entry["joints"] = joints;
    }
    if (measured.image_delay_s) {
      entry["image_delay_s"] = text_of(*measured.image_delay_s);
      entry["sigma_image_delay_s"] = sigma_text_of(measured.sigma_image_delay_s);
    }
  });
}

}  // namespace lapservo::internal
