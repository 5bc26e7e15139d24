#include "lapservo/rig/rig_writer.h"

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/rounded_sigma.h"

namespace lapservo::internal {
namespace {

// {} writes the shortest text that reads back as the same number.
template <typename Numbers>
std::string list_of(const Numbers& numbers) {
  return fmt::format("[{}]", fmt::join(numbers, ", "));
}

template <typename Numbers>
std::string rounded_list_of(const Numbers& sigmas) {
  std::string text;
  for (const double sigma : sigmas) text += (text.empty() ? "" : ", ") + sigma_text(sigma);
  return "[" + text + "]";
}

std::string quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

std::string joints_yaml(const Joints& joints) {
  std::array<std::string, 4> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = quoted(joints.names[i]);
  return fmt::format("    joints:\n      names: {}\n      sign: {}\n      offset: {}\n", list_of(names),
                     list_of(joints.sign), list_of(joints.offset));
}

std::string chromatic_aberration_yaml(const ChromaticAberration& aberration) {
  if (aberration == ChromaticAberration{}) return "";
  return fmt::format("  lateral_chromatic_aberration: {{blue: {}, red: {}}}\n", aberration.blue, aberration.red);
}

std::string camera_yaml(const Camera& camera) {
  const std::array matrix{camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0};
  return fmt::format(
      "camera:\n  image_width: {}\n  image_height: {}\n  distortion_model: plumb_bob\n"
      "  camera_matrix: {{rows: 3, cols: 3, data: {}}}\n"
      "  distortion_coefficients: {{rows: 1, cols: 5, data: {}}}\n  response: {}\n{}{}",
      camera.width_px, camera.height_px, list_of(matrix), list_of(camera.distortion), response_yaml(camera.response),
      chromatic_aberration_yaml(camera.chromatic_aberration), camera.deinterlace ? "  deinterlace: true\n" : "");
}

std::string instrument_yaml(const Instrument& instrument) {
  std::string text =
      fmt::format("  - name: {}\n    marker:\n{}", quoted(instrument.name), marker_yaml(instrument.marker, 6));
  if (instrument.camera_from_rcm) {
    const auto& [rotation, translation] = *instrument.camera_from_rcm;
    text += fmt::format("    camera_from_rcm:\n      translation_m: {}\n      quaternion_xyzw: {}\n",
                        list_of(std::array{translation.x(), translation.y(), translation.z()}),
                        list_of(std::array{rotation.x(), rotation.y(), rotation.z(), rotation.w()}));
  }
  if (instrument.joints) text += joints_yaml(*instrument.joints);
  if (instrument.image_delay_s) text += fmt::format("    image_delay_s: {}\n", *instrument.image_delay_s);
  return text;
}

}  // namespace

std::string response_yaml(const Response& response) {
  switch (response.kind) {
    case Response::Kind::srgb:
      return "srgb";
    case Response::Kind::rec709:
      return "rec709";
    case Response::Kind::power:
      return fmt::format("gamma:{}", response.gamma);
    case Response::Kind::table:
      return fmt::format("{{light: {}, value: {}}}", list_of(response.table_light), list_of(response.table_value));
  }
  return "srgb";
}

std::string measured_camera_yaml(const Camera& camera, const CameraSigmas& sigmas) {
  const std::array matrix{camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0};
  const std::array sigma{sigmas.fx_px, 0.0, sigmas.cx_px, 0.0, sigmas.fy_px, sigmas.cy_px, 0.0, 0.0, 0.0};
  const auto matrix_of = [](int rows, int columns, const std::string& data) {
    return fmt::format("{{rows: {}, cols: {}, data: {}}}\n", rows, columns, data);
  };
  std::string text = fmt::format("image_width: {}\nimage_height: {}\ndistortion_model: plumb_bob\n", camera.width_px,
                                 camera.height_px);
  text += "camera_matrix: " + matrix_of(3, 3, list_of(matrix)) +
          "sigma_camera_matrix: " + matrix_of(3, 3, rounded_list_of(sigma));
  text += "distortion_coefficients: " + matrix_of(1, 5, list_of(camera.distortion)) +
          "sigma_distortion_coefficients: " + matrix_of(1, 5, rounded_list_of(sigmas.distortion));
  text += fmt::format("response: {}\n", response_yaml(camera.response));
  if (sigmas.response > 0) text += fmt::format("sigma_response: {}\n", sigma_text(sigmas.response));
  const ChromaticAberration& aberration = camera.chromatic_aberration;
  text += fmt::format("lateral_chromatic_aberration: {{blue: {}, red: {}}}\n", aberration.blue, aberration.red);
  text += fmt::format("sigma_lateral_chromatic_aberration: {{blue: {}, red: {}}}\n", sigma_text(sigmas.blue),
                      sigma_text(sigmas.red));
  if (camera.deinterlace) text += "deinterlace: true\n";
  return text;
}

std::string marker_yaml(const Marker& marker, int indent) {
  std::string text;
  const auto add = [&](std::string_view key, const std::string& value) {
    text += fmt::format("{:{}}{}: {}\n", "", indent, key, value);
  };
  const auto add_number = [&](std::string_view key, double value, const std::optional<double>& sigma) {
    add(key, fmt::format("{}", value));
    if (sigma) add(fmt::format("sigma_{}", key), fmt::format("{}", *sigma));
  };
  const auto add_list = [&](std::string_view key, const std::array<double, 3>& values,
                            const std::optional<std::array<double, 3>>& sigmas) {
    add(key, list_of(values));
    if (sigmas) add(fmt::format("sigma_{}", key), list_of(*sigmas));
  };
  const MarkerSigmas& sigmas = marker.sigmas;
  add_number("diameter_m", marker.diameter_m, sigmas.diameter_m);
  add_list("hues_deg", marker.hues_deg, sigmas.hues_deg);
  add_list("bands_upper_m", marker.bands_upper_m, sigmas.bands_upper_m);
  add_list("bands_lower_m", marker.bands_lower_m, sigmas.bands_lower_m);
  add_number("seam_rad", marker.seam_rad, sigmas.seam_rad);
  if (marker.wrap_m != 0 || sigmas.wrap_m) add_number("wrap_m", marker.wrap_m, sigmas.wrap_m);
  if (marker.skew_m != 0 || sigmas.skew_m) add_number("skew_m", marker.skew_m, sigmas.skew_m);
  if (marker.gap_rad != 0 || sigmas.gap_rad) add_number("gap_rad", marker.gap_rad, sigmas.gap_rad);
  if (marker.tolerance_m > 0) add("tolerance_m", fmt::format("{}", marker.tolerance_m));
  return text;
}

std::string rig_yaml(const Rig& rig) {
  std::string text = camera_yaml(rig.camera) + "instruments:\n";
  for (const Instrument& instrument : rig.instruments) text += instrument_yaml(instrument);
  return text;
}

}  // namespace lapservo::internal
