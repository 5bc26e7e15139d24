#include "lapservo/rig/rig_writer.h"

#include <array>
#include <optional>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include "lapservo/core/error.h"
#include "lapservo/rig/rig_files.h"
#include "lapservo/tool/dvrk_tool_file.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

template <typename Number>
std::string text_of(const Number& number) {
  if constexpr (std::is_same_v<Number, double>) return yaml_number(number);
  return fmt::format("{}", number);
}
template <typename Item>
std::string text_of(const std::vector<Item>& items) {
  std::vector<std::string> texts;
  for (const Item& item : items) texts.push_back(text_of(item));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}
template <typename Item, std::size_t N>
std::string text_of(const std::array<Item, N>& items) {
  return text_of(std::vector(items.begin(), items.end()));
}
std::string text_of(const Eigen::Vector3d& point) {
  return text_of(std::array{point.x(), point.y(), point.z()});
}
std::string text_of(const ChromaticAberration& aberration) {
  return fmt::format("{{blue: {}, red: {}}}", text_of(aberration.blue), text_of(aberration.red));
}

template <typename Numbers>
std::string matrix_text(int rows, const Numbers& numbers) {
  return fmt::format("{{rows: {}, cols: {}, data: {}}}", rows, numbers.size() / static_cast<std::size_t>(rows),
                     text_of(numbers));
}

std::string covariance_text(const Eigen::MatrixXd& covariance) {
  return matrix_text(static_cast<int>(covariance.rows()),
                     std::vector<double>(covariance.data(), covariance.data() + covariance.size()));
}

// The fields of Camera and of CameraSigmas.
template <typename Pinhole>
std::string pinhole_text(const Pinhole& k, double last) {
  return matrix_text(3, std::array{k.fx_px, 0.0, k.cx_px, 0.0, k.fy_px, k.cy_px, 0.0, 0.0, last});
}

std::string quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

// Keys and values of one map.
class Lines {
 public:
  explicit Lines(int indent) : indent_(indent) {}

  void add(std::string_view key, const std::string& value) {
    text_ += fmt::format("{:{}}{}: {}\n", "", indent_, key, value);
  }
  void add_map(std::string_view key, const std::string& lines) {
    text_ += fmt::format("{:{}}{}:\n{}", "", indent_, key, lines);
  }
  template <typename Value>
  void add_measured(std::string_view key, const Value& value, const std::optional<Value>& sigma) {
    add(key, text_of(value));
    if (sigma) add(fmt::format("sigma_{}", key), text_of(*sigma));
  }
  // Where it is not what a rig without it has.
  void add_unless_zero(std::string_view key, double value, const std::optional<double>& sigma) {
    if (value != 0 || sigma) add_measured(key, value, sigma);
  }
  const std::string& text() const { return text_; }

 private:
  int indent_;
  std::string text_;
};

std::string table_text(const Response& response) {
  std::string text =
      fmt::format("{{light: {}, value: {}", text_of(response.table_light), text_of(response.table_value));
  if (!response.sigma_light.empty()) text += ", sigma_light: " + text_of(response.sigma_light);
  if (!response.sigma_value.empty()) text += ", sigma_value: " + text_of(response.sigma_value);
  return text + "}";
}

std::string response_text(const Response& response) {
  switch (response.kind) {
    case Response::Kind::srgb:
      return "srgb";
    case Response::Kind::rec709:
      return "rec709";
    case Response::Kind::power:
      return fmt::format("gamma:{}", response.gamma);
    case Response::Kind::table:
      return table_text(response);
  }
  return "srgb";
}

std::string joints_yaml(const Joints& joints, int indent) {
  Lines lines(indent);
  std::array<std::string, 4> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = quoted(joints.names[i]);
  lines.add("names", text_of(names));
  lines.add("sign", text_of(joints.sign));
  lines.add_measured("offset", joints.offset, joints.sigma_offset);
  return lines.text();
}

std::string transform_yaml(const Instrument& instrument, int indent) {
  Lines lines(indent);
  const Eigen::Vector3d& t = instrument.camera_from_rcm->translation;
  const Eigen::Quaterniond& q = instrument.camera_from_rcm->rotation;
  lines.add_measured("translation_m", std::array{t.x(), t.y(), t.z()}, instrument.sigma_translation_m);
  lines.add_measured("quaternion_xyzw", std::array{q.x(), q.y(), q.z(), q.w()}, instrument.sigma_quaternion_xyzw);
  if (const auto& covariance = instrument.registration_covariance)
    lines.add("covariance", covariance_text(*covariance));
  return lines.text();
}

// Relative to the folder, by the names of links on the way: they may lead elsewhere later. Empty where there is none.
fs::path path_from(const fs::path& folder, const fs::path& file) {
  std::error_code error;
  fs::path relative = file.lexically_relative(folder);
  if (fs::equivalent(folder / relative, file, error)) return relative;
  relative = fs::relative(file.parent_path(), folder, error);  // a link with ".." behind it
  return relative.empty() ? relative : (relative / file.filename()).lexically_normal();
}

// A rig that a link in another folder leads to is read from both.
std::string path_yaml(const fs::path& file, const fs::path& destination) {
  std::error_code error;
  const fs::path whole = fs::absolute(file, error), folder = fs::absolute(destination, error).parent_path();
  const bool in_two_folders = fs::is_symlink(destination, error) &&
                              !fs::equivalent(fs::canonical(destination, error).parent_path(), folder, error);
  const fs::path relative = in_two_folders ? fs::path() : path_from(folder, whole);
  YAML::Emitter text;
  text << (relative.empty() ? whole : relative).string();
  return text.c_str();
}

std::string wrist_joints_yaml(const Tool& tool, int indent) {
  std::string text;
  for (const WristJoint& joint : tool.wrist)
    text += fmt::format("{:{}}- {{name: {}, alpha_rad: {}, a_m: {}, theta_rad: {}, d_m: {}}}\n", "", indent,
                        quoted(joint.name), text_of(joint.alpha_rad), text_of(joint.a_m), text_of(joint.theta_rad),
                        text_of(joint.d_m));
  return text;
}

void add_wrist(Lines& lines, const Tool& tool, const fs::path& destination) {
  lines.add("tip_in_last_joint_m", text_of(tool.last_from_tip.translation));
  if (!tool.file.empty() && !destination.empty()) return lines.add("file", path_yaml(tool.file, destination));
  const Eigen::Quaterniond& q = tool.last_from_tip.rotation;
  lines.add_map("joints", wrist_joints_yaml(tool, 8));
  lines.add("tip_quaternion_xyzw", text_of(std::array{q.x(), q.y(), q.z(), q.w()}));
  if (tool.snake_like) lines.add("snake_like", "true");
}

void add_readings(Lines& lines, const std::vector<WristJoint>& wrist) {
  std::vector<double> offsets, sigmas;
  for (const WristJoint& joint : wrist) offsets.push_back(joint.offset_rad), sigmas.push_back(joint.sigma_reading_rad);
  lines.add("offset_rad", text_of(offsets));
  lines.add("sigma_reading_rad", text_of(sigmas));
}

std::string tool_yaml(const Tool& tool, const fs::path& destination, int indent) {
  Lines lines(indent);
  const bool straight = tool.wrist.empty();
  if (!straight) add_wrist(lines, tool, destination), add_readings(lines, tool.wrist);
  if (!tool.place) return lines.text();
  lines.add(straight ? "tip_in_marker_m" : "wrist_in_marker_m", text_of(tool.place->base_in_marker_m));
  if (!straight) lines.add("azimuth_rad", text_of(tool.place->azimuth_rad));
  if (tool.place->covariance.isZero(0)) return lines.text();
  const Eigen::Index size = straight ? 3 : 4 + static_cast<Eigen::Index>(tool.wrist.size());
  lines.add("covariance", covariance_text(tool.place->covariance.topLeftCorner(size, size)));
  return lines.text();
}

std::string instrument_yaml(const Instrument& instrument, const fs::path& destination) {
  Lines lines(4);
  lines.add_map("marker", marker_yaml(instrument.marker, 6));
  if (instrument.camera_from_rcm) lines.add_map("camera_from_rcm", transform_yaml(instrument, 6));
  if (instrument.joints) lines.add_map("joints", joints_yaml(*instrument.joints, 6));
  if (instrument.image_delay_s)
    lines.add_measured("image_delay_s", *instrument.image_delay_s, instrument.sigma_image_delay_s);
  if (instrument.tool) lines.add_map("tool", tool_yaml(*instrument.tool, destination, 6));
  return fmt::format("  - name: {}\n{}", quoted(instrument.name), lines.text());
}

template <typename Read>
bool is_file_of(const Read& read, const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;
  try {
    read(path);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

}  // namespace

std::string yaml_number(double number) {
  std::string text = fmt::format("{}", number);
  if (const auto e = text.find('e'); e < text.size() && text.find('.') > e) text.insert(e, ".0");
  return text;
}

std::string camera_yaml(const Camera& camera, int indent) {
  const CameraSigmas& sigmas = camera.sigmas;
  Lines lines(indent);
  lines.add("image_width", text_of(camera.width_px));
  lines.add("image_height", text_of(camera.height_px));
  lines.add("distortion_model", "plumb_bob");
  lines.add("camera_matrix", pinhole_text(camera, 1));
  if (sigmas.fx_px != 0 || sigmas.fy_px != 0 || sigmas.cx_px != 0 || sigmas.cy_px != 0)
    lines.add("sigma_camera_matrix", pinhole_text(sigmas, 0));
  lines.add("distortion_coefficients", matrix_text(1, camera.distortion));
  if (sigmas.distortion != CameraSigmas{}.distortion)
    lines.add("sigma_distortion_coefficients", matrix_text(1, sigmas.distortion));
  if (camera.covariance) lines.add("covariance", covariance_text(*camera.covariance));
  lines.add("response", response_text(camera.response));
  if (camera.response.sigma) lines.add("sigma_response", text_of(*camera.response.sigma));
  const bool measured = sigmas.blue != 0 || sigmas.red != 0;
  if (measured || camera.chromatic_aberration != ChromaticAberration{})
    lines.add_measured("lateral_chromatic_aberration", camera.chromatic_aberration,
                       measured ? std::optional(ChromaticAberration{sigmas.blue, sigmas.red}) : std::nullopt);
  if (camera.deinterlace) lines.add("deinterlace", "true");
  if (camera.readout_s != 0) lines.add("readout_s", text_of(camera.readout_s));
  return lines.text();
}

std::string marker_yaml(const Marker& marker, int indent) {
  const MarkerSigmas& sigmas = marker.sigmas;
  Lines lines(indent);
  lines.add_measured("diameter_m", marker.diameter_m, sigmas.diameter_m);
  lines.add_measured("hues_deg", marker.hues_deg, sigmas.hues_deg);
  lines.add_measured("bands_upper_m", marker.bands_upper_m, sigmas.bands_upper_m);
  lines.add_measured("bands_lower_m", marker.bands_lower_m, sigmas.bands_lower_m);
  lines.add_measured("seam_rad", marker.seam_rad, sigmas.seam_rad);
  lines.add_unless_zero("wrap_m", marker.wrap_m, sigmas.wrap_m);
  lines.add_unless_zero("skew_m", marker.skew_m, sigmas.skew_m);
  lines.add_unless_zero("gap_rad", marker.gap_rad, sigmas.gap_rad);
  lines.add_unless_zero("tolerance_m", marker.tolerance_m, sigmas.tolerance_m);
  return lines.text();
}

std::string rig_yaml(const Rig& rig, const fs::path& destination) {
  const bool named = !rig.camera_file.empty() && !destination.empty();
  Lines lines(0);
  if (named)
    lines.add("camera", path_yaml(rig.camera_file, destination));
  else
    lines.add_map("camera", camera_yaml(rig.camera, 2));
  std::string instruments;
  for (const Instrument& instrument : rig.instruments) instruments += instrument_yaml(instrument, destination);
  lines.add_map("instruments", instruments);
  return lines.text();
}

std::string measured_rig_yaml(const Rig& rig, const fs::path& destination) {
  const std::string yaml = rig_yaml(rig, destination);
  parse_rig(yaml, fmt::format("{} as it would be written", destination.empty() ? "rig" : destination.string()),
            destination.parent_path());
  return yaml;
}

void refuse_rig_over_part(const fs::path& destination) {
  if (is_file_of(load_camera, destination) || is_file_of(read_dvrk_tool, destination))
    throw InputError(destination.string(),
                     "is the file of a camera or a tool, which a whole rig would replace: expected another name");
}

void refuse_part_over_rig(const fs::path& destination, const std::string& part) {
  if (is_file_of(load_rig, destination))
    throw InputError(destination.string(),
                     "is a rig, which its " + part + " alone would replace: expected another name");
}

}  // namespace lapservo::internal
