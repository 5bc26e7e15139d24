#include "lapservo/rig/rig.h"

#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>
#include <system_error>
#include <utility>

#include <yaml-cpp/yaml.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/marker/decoder.h"

namespace lapservo {
namespace {
namespace fs = std::filesystem;

constexpr std::size_t largest_file_bytes = 1 << 20;

// A node with where it stands, so that every complaint can name file and field.
class Field {
 public:
  Field(std::string source, std::string path, const YAML::Node& node)
      : source_(std::move(source)), path_(std::move(path)), node_(node) {}

  [[noreturn]] void fail(std::string_view value, std::string_view expected) const {
    throw InputError(source_, path_.empty() ? "file" : path_, value, expected);
  }
  // For complaints that name value and expectation themselves, as "field: is value, expected ...".
  [[noreturn]] void fail_within(const std::string& problem) const { throw InputError(source_, path_ + "." + problem); }
  std::string value_text() const {
    if (!node_.IsDefined() || node_.IsNull()) return "missing";
    if (node_.IsScalar()) return node_.Scalar().empty() ? "''" : node_.Scalar();
    return node_.IsSequence() ? "a list of " + std::to_string(node_.size()) : "a map";
  }
  bool present() const { return node_.IsDefined() && !node_.IsNull(); }
  bool is_scalar() const { return present() && node_.IsScalar(); }

  Field operator[](const std::string& key) const {
    if (!present() || !node_.IsMap()) fail(value_text(), "a map with '" + key + "'");
    return {source_, path_.empty() ? key : path_ + "." + key, node_[key]};
  }
  std::vector<Field> list(std::string_view expected) const {
    if (!present() || !node_.IsSequence()) fail(value_text(), expected);
    std::vector<Field> items;
    for (std::size_t i = 0; i < node_.size(); ++i)
      items.emplace_back(source_, path_ + "[" + std::to_string(i) + "]", node_[i]);
    return items;
  }
  std::string text(std::string_view expected) const {
    if (!is_scalar() || node_.Scalar().empty()) fail(value_text(), expected);
    return node_.Scalar();
  }
  double number(std::string_view expected) const {
    const auto value = is_scalar() ? parse_finite(node_.Scalar()) : std::nullopt;
    if (!value) fail(value_text(), expected);
    return *value;
  }
  double number_between(double low, double high, std::string_view expected) const {
    const double value = number(expected);
    if (!(value >= low && value <= high)) fail(value_text(), expected);
    return value;
  }
  template <std::size_t N>
  std::array<double, N> numbers(std::string_view expected, double largest = std::numeric_limits<double>::infinity(),
                                std::string_view item_expected = "a finite number") const {
    const auto items = list(expected);
    if (items.size() != N) fail(value_text(), expected);
    std::array<double, N> values{};
    for (std::size_t i = 0; i < N; ++i) values[i] = items[i].number_between(-largest, largest, item_expected);
    return values;
  }
  const std::string& source() const { return source_; }

 private:
  std::string source_, path_;
  YAML::Node node_;
};

std::string read_text(const fs::path& path) {
  std::error_code ignored;  // a name that no file can have is a file that can't be opened
  if (fs::is_directory(path, ignored)) throw InputError(path.string(), "is a folder, expected a YAML file");
  std::ifstream file(path, std::ios::binary);
  if (!file) throw InputError(path.string(), "can't be opened, expected a YAML file");
  std::string text(largest_file_bytes + 1, '\0');  // a byte more, to tell what is too long; /dev/zero has no end
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.empty()) throw InputError(path.string(), "is empty, expected a YAML file");
  return text;
}

// yaml-cpp recurses over nesting without a limit of its own: refuse what no rig needs before it parses.
bool nests_too_deeply(std::string_view yaml) {
  int depth = 0;
  for (const char c : yaml) {
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    if (depth > 16) return true;
  }
  std::size_t run = 0;  // "- - - -" and "? ? ?" and ": : :" nest too
  for (const char c : yaml) {
    if (c == '-' || c == '?' || c == ':') {
      if (++run > 64) return true;
    } else if (c != ' ' && c != '\n' && c != '\t') {
      run = 0;
    }
  }
  return false;
}

Field parse_yaml(std::string_view yaml, const std::string& source) {
  if (yaml.size() > largest_file_bytes) throw InputError(source, "is larger than 1 MiB, expected a rig file");
  if (nests_too_deeply(yaml)) throw InputError(source, "nests more deeply than a rig file does");
  try {
    return {source, "", YAML::Load(std::string(yaml))};
  } catch (const YAML::Exception& error) {
    throw InputError(source, std::string("is not YAML: ") + error.what());
  }
}

Response parse_response(const Field& field) {
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

int parse_image_size(const Field& field) {
  constexpr auto expected = "a whole number of pixels, 16 to 16384";
  const double value = field.number_between(16, 16384, expected);
  if (value != std::floor(value)) field.fail(field.value_text(), expected);
  return static_cast<int>(value);
}

// Every pixel must have a ray, else a marker there would be seen and not understood.
void check_invertible(const Camera& camera, const Field& coefficients) {
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

Camera parse_camera_fields(const Field& field) {
  Camera camera;
  camera.width_px = parse_image_size(field["image_width"]);
  camera.height_px = parse_image_size(field["image_height"]);
  if (const Field model = field["distortion_model"]; model.present() && model.text("plumb_bob") != "plumb_bob")
    model.fail(model.value_text(), "plumb_bob");

  const Field matrix = field["camera_matrix"]["data"];
  const auto k = matrix.numbers<9>("nine numbers, fx 0 cx 0 fy cy 0 0 1");
  const bool pinhole = k[0] > 0 && k[4] > 0 && k[1] == 0 && k[3] == 0 && k[6] == 0 && k[7] == 0 && k[8] == 1;
  if (!pinhole || k[0] > 1e6 || k[4] > 1e6 || std::abs(k[2]) > 1e6 || std::abs(k[5]) > 1e6) {
    std::ostringstream got;
    for (const double value : k) got << value << ' ';
    matrix.fail(got.str(), "fx 0 cx 0 fy cy 0 0 1 with fx and fy above 0 (pixels)");
  }
  camera.fx_px = k[0], camera.cx_px = k[2], camera.fy_px = k[4], camera.cy_px = k[5];
  if (const Field coefficients = field["distortion_coefficients"]; coefficients.present()) {
    const Field data = coefficients["data"];
    camera.distortion = data.numbers<5>("five numbers, k1 k2 p1 p2 k3");
    check_invertible(camera, data);
  }
  camera.response = parse_response(field["response"]);
  return camera;
}

Camera parse_camera(const Field& field, const fs::path& folder) {
  if (!field.is_scalar()) return parse_camera_fields(field);
  const fs::path path = folder / field.text("a map or the path of a camera file");
  return parse_camera_fields(parse_yaml(read_text(path), path.string()));
}

Marker parse_marker(const Field& field) {
  Marker marker;
  marker.diameter_m = field["diameter_m"].number("0.0005 to 0.1 (metres)");
  if (const Field hues = field["hues_deg"]; hues.present()) marker.hues_deg = hues.numbers<3>("three hues in degrees");
  marker.bands_upper_m = field["bands_upper_m"].numbers<3>("three lengths in metres");
  marker.bands_lower_m = field["bands_lower_m"].numbers<3>("three lengths in metres");
  if (const Field seam = field["seam_rad"]; seam.present()) marker.seam_rad = seam.number("an angle in radians");
  if (const std::string problem = marker_problem(marker); !problem.empty()) field.fail_within(problem);
  if (const std::string problem = decoding_problem(marker); !problem.empty())
    field.fail("not decodable", "bands whose cross-ratio is monotonic over the rotation: " + problem);
  return marker;
}

Rigid3 parse_transform(const Field& field) {
  const auto t = field["translation_m"].numbers<3>("x y z in metres", 10, "a length within 10 m");
  const Field quaternion = field["quaternion_xyzw"];
  const auto q = quaternion.numbers<4>("x y z w of a unit quaternion");
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (!(std::abs(rotation.norm() - 1) < 1e-2))
    quaternion.fail("of norm " + std::to_string(rotation.norm()), "x y z w of a unit quaternion");
  return {rotation.normalized(), {t[0], t[1], t[2]}};
}

Instrument parse_instrument(const Field& field) {
  Instrument instrument;
  instrument.name = field["name"].text("a name");
  for (const char c : instrument.name)
    if (c == ',' || static_cast<unsigned char>(c) < ' ')
      field["name"].fail(instrument.name, "a name without commas and control characters");
  instrument.marker = parse_marker(field["marker"]);
  if (const Field transform = field["camera_from_rcm"]; transform.present())
    instrument.camera_from_rcm = parse_transform(transform);
  return instrument;
}

void check_distinguishable(const std::vector<Instrument>& instruments, const std::vector<Field>& fields) {
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

}  // namespace

Rig parse_rig(std::string_view yaml, const std::string& source, const fs::path& folder) {
  try {
    const Field root = parse_yaml(yaml, source);
    Rig rig;
    rig.camera = parse_camera(root["camera"], folder);
    const Field list = root["instruments"];
    const auto fields = list.list("a list of instruments");
    if (fields.empty() || fields.size() > 8) list.fail(list.value_text(), "one to eight instruments");
    for (const Field& field : fields) rig.instruments.push_back(parse_instrument(field));
    check_distinguishable(rig.instruments, fields);
    return rig;
  } catch (const YAML::Exception& error) {
    throw InputError(source, std::string("can't be read as a rig: ") + error.what());
  }
}

Rig load_rig(const fs::path& path) {
  return parse_rig(read_text(path), path.string(), path.parent_path());
}

}  // namespace lapservo
