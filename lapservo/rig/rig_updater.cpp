#include "lapservo/rig/rig_updater.h"

#include <system_error>

#include <yaml-cpp/yaml.h>

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

}  // namespace

std::string updated_rig_yaml(const fs::path& path, const fs::path& destination, std::size_t instrument,
                             const Marker& marker) {
  YAML::Node root = YAML::LoadFile(path.string());
  if (YAML::Node camera = root["camera"]; camera.IsScalar())
    root["camera"] = camera_path_from(camera.Scalar(), path, destination);
  YAML::Node entry = root["instruments"][instrument]["marker"];
  for (const auto& number : YAML::Load(marker_yaml(marker, 0))) entry[number.first.Scalar()] = number.second;
  for (const char* key : {"wrap_m", "skew_m", "gap_rad", "tolerance_m"})
    if (!YAML::Load(marker_yaml(marker, 0))[key]) entry.remove(key);
  return text_of(root);
}

std::string updated_rig_yaml(const fs::path& path, const Camera& camera, const CameraSigmas& sigmas) {
  YAML::Node root = YAML::LoadFile(path.string());
  root["camera"] = YAML::Load(measured_camera_yaml(camera, sigmas));
  return text_of(root);
}

}  // namespace lapservo::internal
