#include "lapservo/rig/rig.h"

#include <array>
#include <cmath>
#include <sstream>

#include "lapservo/core/csv.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/rig/yaml_field.h"

namespace lapservo {
namespace {
namespace fs = std::filesystem;

constexpr auto file_kind = "rig file";
constexpr double largest_tolerance_m = 5e-3;

Response parse_response(const YamlField& field) {
  constexpr auto expected = "srgb, linear or gamma:VALUE with a value of 0.2 to 5";
  if (!field.present()) return {};
  const std::string text = field.text(expected);
  if (text == "srgb") return {};
  if (text == "linear") return {Response::Kind::power, 1};
  constexpr std::string_view prefix = "gamma:";
  const auto gamma =
      text.starts_with(prefix) ? parse_finite(std::string_view(text).substr(prefix.size())) : std::nullopt;
  if (!gamma || *gamma < 0.2 || *gamma > 5) field.fail(text, expected);
  return {Response::Kind::power, *gamma};
}

int parse_image_size(const YamlField& field) {
  constexpr auto expected = "a whole number of pixels, 16 to 16384";
  const double value = field.number_between(16, 16384, expected);
  if (value != std::floor(value)) field.fail(field.value_text(), expected);
  return static_cast<int>(value);
}

// Every pixel must have a ray, else a marker there would be seen and not understood.
void check_invertible(const Camera& camera, const YamlField& coefficients) {
  const double u_end = camera.width_px - 1, v_end = camera.height_px - 1;
  constexpr int steps = 8;
  for (int i = 0; i <= steps; ++i)
    for (const Eigen::Vector2d& border :
         {Eigen::Vector2d(u_end * i / steps, 0), Eigen::Vector2d(u_end * i / steps, v_end),
          Eigen::Vector2d(0, v_end * i / steps), Eigen::Vector2d(u_end, v_end * i / steps)})
      if (!camera.ideal_from_raw(border))
        coefficients.fail("not invertible at the image's border",
                          "k1 k2 p1 p2 k3 of a calibration that covers the image");
}

Camera parse_camera_fields(const YamlField& field) {
  Camera camera;
  camera.width_px = parse_image_size(field["image_width"]);
  camera.height_px = parse_image_size(field["image_height"]);
  if (const YamlField model = field["distortion_model"]; model.present() && model.text("plumb_bob") != "plumb_bob")
    model.fail(model.value_text(), "plumb_bob");

  const YamlField matrix = field["camera_matrix"]["data"];
  const auto k = matrix.numbers<9>("nine numbers, fx 0 cx 0 fy cy 0 0 1");
  const bool pinhole = k[0] > 0 && k[4] > 0 && k[1] == 0 && k[3] == 0 && k[6] == 0 && k[7] == 0 && k[8] == 1;
  if (!pinhole || k[0] > 1e6 || k[4] > 1e6 || std::abs(k[2]) > 1e6 || std::abs(k[5]) > 1e6) {
    std::ostringstream got;
    for (const double value : k) got << value << ' ';
    matrix.fail(got.str(), "fx 0 cx 0 fy cy 0 0 1 with fx and fy above 0 (pixels)");
  }
  camera.fx_px = k[0], camera.cx_px = k[2], camera.fy_px = k[4], camera.cy_px = k[5];
  if (const YamlField coefficients = field["distortion_coefficients"]; coefficients.present()) {
    const YamlField data = coefficients["data"];
    camera.distortion = data.numbers<5>("five numbers, k1 k2 p1 p2 k3");
    check_invertible(camera, data);
  }
  camera.response = parse_response(field["response"]);
  return camera;
}

Camera parse_camera(const YamlField& field, const fs::path& folder) {
  if (!field.is_scalar()) return parse_camera_fields(field);
  const fs::path path = folder / field.text("a map or the path of a camera file");
  return parse_camera_fields(YamlField::read(path, file_kind));
}

Marker parse_marker(const YamlField& field) {
  Marker marker;
  marker.diameter_m = field["diameter_m"].number("0.0005 to 0.1 (metres)");
  if (const YamlField hues = field["hues_deg"]; hues.present())
    marker.hues_deg = hues.numbers<3>("three hues in degrees");
  marker.bands_upper_m = field["bands_upper_m"].numbers<3>("three lengths in metres");
  marker.bands_lower_m = field["bands_lower_m"].numbers<3>("three lengths in metres");
  if (const YamlField seam = field["seam_rad"]; seam.present()) marker.seam_rad = seam.number("an angle in radians");
  if (const YamlField tolerance = field["tolerance_m"]; tolerance.present())
    marker.tolerance_m = tolerance.number_between(0, largest_tolerance_m, "0 to 0.005 (metres)");
  if (const std::string problem = marker_problem(marker); !problem.empty()) field.fail_within(problem);
  if (const std::string problem = decoding_problem(marker); !problem.empty())
    field.fail("not decodable", "bands whose cross-ratio is monotonic over the rotation: " + problem);
  return marker;
}

Rigid3 parse_transform(const YamlField& field) {
  const auto t = field["translation_m"].numbers<3>("x y z in metres", 10, "a length within 10 m");
  const YamlField quaternion = field["quaternion_xyzw"];
  const auto q = quaternion.numbers<4>("x y z w of a unit quaternion");
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (!(std::abs(rotation.norm() - 1) < 1e-2))
    quaternion.fail("of norm " + std::to_string(rotation.norm()), "x y z w of a unit quaternion");
  return {rotation.normalized(), {t[0], t[1], t[2]}};
}

Instrument parse_instrument(const YamlField& field) {
  Instrument instrument;
  instrument.name = field["name"].text("a name");
  for (const char c : instrument.name)
    if (c == ',' || static_cast<unsigned char>(c) < ' ')
      field["name"].fail(instrument.name, "a name without commas and control characters");
  instrument.marker = parse_marker(field["marker"]);
  if (const YamlField transform = field["camera_from_rcm"]; transform.present())
    instrument.camera_from_rcm = parse_transform(transform);
  return instrument;
}

void check_distinguishable(const std::vector<Instrument>& instruments, const std::vector<YamlField>& fields) {
  for (std::size_t i = 0; i < instruments.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      if (instruments[i].name == instruments[j].name)
        fields[i]["name"].fail(instruments[i].name, "a name that no other instrument has");
      if (same_colour_order(instruments[i].marker, instruments[j].marker))
        fields[i]["marker"]["hues_deg"].fail("the order of " + instruments[j].name,
                                             "another order of colours: it is what names the instrument");
      if (reversed_colour_order(instruments[i].marker, instruments[j].marker))
        fields[i]["marker"]["hues_deg"].fail("the order of " + instruments[j].name + " reversed",
                                             "another middle colour: turned end for end, the two look the same");
    }
}

Rig parse_root(const YamlField& root, const fs::path& folder) {
  Rig rig;
  rig.camera = parse_camera(root["camera"], folder);
  const YamlField list = root["instruments"];
  const auto fields = list.list("a list of instruments");
  if (fields.empty() || fields.size() > 8) list.fail(list.value_text(), "one to eight instruments");
  for (const YamlField& field : fields) rig.instruments.push_back(parse_instrument(field));
  check_distinguishable(rig.instruments, fields);
  return rig;
}

}  // namespace

Rig parse_rig(std::string_view yaml, const std::string& source, const fs::path& folder) {
  return parse_root(YamlField::parse(yaml, source, file_kind), folder);
}

Rig load_rig(const fs::path& path) {
  return parse_root(YamlField::read(path, file_kind), path.parent_path());
}

}  // namespace lapservo
