#include "lapservo/rig/rig_writer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace lapservo {
namespace {

// {} writes the shortest text that reads back as the same number.
template <typename Numbers>
std::string list_of(const Numbers& numbers) {
  return fmt::format("[{}]", fmt::join(numbers, ", "));
}

std::string quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}

std::string camera_yaml(const Camera& camera) {
  const std::array matrix{camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0};
  const std::string response =
      camera.response.kind == Response::Kind::srgb ? "srgb" : fmt::format("gamma:{}", camera.response.gamma);
  return fmt::format(
      "camera:\n  image_width: {}\n  image_height: {}\n  distortion_model: plumb_bob\n"
      "  camera_matrix: {{rows: 3, cols: 3, data: {}}}\n"
      "  distortion_coefficients: {{rows: 1, cols: 5, data: {}}}\n  response: {}\n",
      camera.width_px, camera.height_px, list_of(matrix), list_of(camera.distortion), response);
}

std::string instrument_yaml(const Instrument& instrument) {
  const Marker& marker = instrument.marker;
  std::string text = fmt::format(
      "  - name: {}\n    marker:\n      diameter_m: {}\n      hues_deg: {}\n      bands_upper_m: {}\n"
      "      bands_lower_m: {}\n      seam_rad: {}\n",
      quoted(instrument.name), marker.diameter_m, list_of(marker.hues_deg), list_of(marker.bands_upper_m),
      list_of(marker.bands_lower_m), marker.seam_rad);
  if (instrument.camera_from_rcm) {
    const auto& [rotation, translation] = *instrument.camera_from_rcm;
    text += fmt::format("    camera_from_rcm:\n      translation_m: {}\n      quaternion_xyzw: {}\n",
                        list_of(std::array{translation.x(), translation.y(), translation.z()}),
                        list_of(std::array{rotation.x(), rotation.y(), rotation.z(), rotation.w()}));
  }
  return text;
}

}  // namespace

std::string rig_yaml(const Rig& rig) {
  std::string text = camera_yaml(rig.camera) + "instruments:\n";
  for (const Instrument& instrument : rig.instruments) text += instrument_yaml(instrument);
  return text;
}

}  // namespace lapservo
