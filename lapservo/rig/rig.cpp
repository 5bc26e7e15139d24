#include "lapservo/rig/rig.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/core/csv.h"
#include "lapservo/core/dense_matrix.h"
#include "lapservo/core/joint_units.h"
#include "lapservo/core/known_keys.h"
#include "lapservo/core/yaml_field.h"
#include "lapservo/geometry/field_of_view.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/rig/camera_formats.h"
#include "lapservo/rig/check_rig.h"
#include "lapservo/rig/rig_files.h"
#include "lapservo/tool/dvrk_tool_file.h"

namespace lapservo {
using namespace internal;
namespace {
namespace fs = std::filesystem;

constexpr auto file_kind = "rig file";
constexpr double max_tolerance_m = 5e-3;
constexpr double rotation_tolerance = 2e-4;  // what four typed digits leave

// One standard deviation each, where the key is there; not below 0, by expect_keys().
std::optional<double> sigma_in(const YamlField& map, const char* key) {
  const YamlField field = map[key];
  return field.present() ? std::optional(field.number(sigmas_expected)) : std::nullopt;
}
template <std::size_t N>
std::optional<std::array<double, N>> sigmas_in(const YamlField& map, const char* key) {
  const YamlField field = map[key];
  return field.present() ? std::optional(field.numbers<N>(sigmas_expected)) : std::nullopt;
}

int parse_image_size(const YamlField& field) {
  constexpr auto expected = "a whole number of pixels, 16 to 16384";
  const double value = field.number_between(16, 16384, expected);
  if (value != std::floor(value)) field.fail(field.value_text(), expected);
  return static_cast<int>(value);
}

// The `rows` and `cols` of a ROS matrix, where they are there.
void check_shape(const YamlField& field, int rows, int columns) {
  for (const auto& [key, size] : {std::pair{"rows", rows}, {"cols", columns}})
    if (const YamlField given = field[key]; given.present() && given.number("a whole number") != size)
      given.fail(given.value_text(), std::to_string(size));
}

// A ROS matrix: rows and cols say how the numbers of data lie.
template <std::size_t N>
std::array<double, N> parse_matrix(const YamlField& field, int rows, int columns, std::string_view expected) {
  expect_keys(field, {{"rows", "cols", "data"}, {}});
  const auto numbers = field["data"].numbers<N>(expected);
  check_shape(field, rows, columns);
  return numbers;
}

// Refuses what is not symmetric or has a negative variance in some direction.
Eigen::MatrixXd parse_covariance(const YamlField& field, int size, std::string_view expected) {
  expect_keys(field, {{"rows", "cols", "data"}, {}});
  const auto items = field["data"].list(expected);
  if (items.size() != static_cast<std::size_t>(size) * static_cast<std::size_t>(size))
    field["data"].fail(field["data"].value_text(), expected);
  check_shape(field, size, size);
  Eigen::MatrixXd given(size, size);
  for (std::size_t i = 0; i < items.size(); ++i)
    given.reshaped()[static_cast<Eigen::Index>(i)] = items[i].number(expected);
  const Eigen::MatrixXd covariance = (given + given.transpose()) / 2;
  const double rounding = 1e-9 * covariance.cwiseAbs().maxCoeff();
  if (!((given - covariance).cwiseAbs().maxCoeff() <= rounding) ||
      !(eigenvalues_of_symmetric(covariance).minCoeff() >= -rounding))
    field.fail("not symmetric, or of negative variance", expected);
  return covariance;
}

Eigen::Quaterniond parse_unit_quaternion(const YamlField& field) {
  const auto q = field.numbers<4>("x y z w of a unit quaternion");
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (!(std::abs(rotation.norm() - 1) < rotation_tolerance))
    field.fail("of norm " + std::to_string(rotation.norm()), "x y z w of a unit quaternion, to four digits");
  // A normalised quaternion keeps its bits, however often a rig is written and read.
  const bool unit = std::abs(rotation.squaredNorm() - 1) < 1e-14;
  return unit ? rotation : rotation.normalized();
}

std::array<double, 5> parse_distortion(const YamlField& field) {
  expect_keys(field, {{"rows", "cols", "data"}, {}});
  const YamlField data = field["data"];
  std::vector<double> numbers;
  for (const YamlField& item : data.list("k1 k2 p1 p2 k3")) numbers.push_back(item.number("a finite number"));
  if (const char* expected = expected_distortion(numbers)) data.fail(data.value_text(), expected);
  if (!numbers.empty()) check_shape(field, 1, static_cast<int>(numbers.size()));
  std::array<double, 5> coefficients{};
  std::copy_n(numbers.begin(), std::min(numbers.size(), coefficients.size()), coefficients.begin());
  return coefficients;
}

void check_distortion_model(const YamlField& field) {
  for (const char* key : {"distortion_model", "camera_model"}) {
    const YamlField model = field[key];
    if (!model.present() || model.text("plumb_bob") == "plumb_bob") continue;
    if (model.text("plumb_bob") != "rational_polynomial")
      model.fail(model.value_text(), "plumb_bob, which lapservo calibrate camera fits");
  }
}

// Keys of rectified images are not used, but must be valid; regions and bins of the sensor would have other pixels than
// those of camera_matrix.
void check_unused(const YamlField& field) {
  if (const YamlField rectification = field["rectification_matrix"]; rectification.present()) {
    const auto r = parse_matrix<9>(rectification, 3, 3, "nine numbers of a rotation");
    const Eigen::Matrix3d rotation = Eigen::Map<const Eigen::Matrix3d>(r.data());
    if (!(rotation * rotation.transpose()).isIdentity(rotation_tolerance) || rotation.determinant() < 0)
      rectification.fail("no rotation", "nine numbers of a rotation");
  }
  if (const YamlField projection = field["projection_matrix"]; projection.present())
    parse_matrix<12>(projection, 3, 4, "twelve numbers");
  for (const char* key : {"binning_x", "binning_y"})
    if (const YamlField binning = field[key]; binning.present())
      binning.number_between(0, 1, "0 or 1: a camera_matrix of the pixels as they are");
  const YamlField roi = field["roi"];
  if (!roi.present()) return;
  expect_keys(roi, {{"x_offset", "y_offset", "height", "width", "do_rectify"}, {}});
  for (const char* key : {"x_offset", "y_offset"})
    if (const YamlField offset = roi[key]; offset.present())
      offset.number_between(0, 0, "0: a camera_matrix of the pixels as they are");
}

std::vector<double> rising_from_0_to_1(const YamlField& field) {
  constexpr auto expected = "2 to 4096 numbers that rise from 0 to 1";
  std::vector<double> numbers;
  for (const YamlField& item : field.list(expected)) {
    numbers.push_back(item.number_between(0, 1, expected));
    if (numbers.size() > 1 && !(numbers.back() > numbers[numbers.size() - 2])) item.fail(item.value_text(), expected);
  }
  if (numbers.size() < 2 || numbers.size() > 4096 || numbers.front() != 0 || numbers.back() != 1)
    field.fail(field.value_text(), expected);
  return numbers;
}

std::vector<double> sigmas_like(const YamlField& field, std::size_t size) {
  std::vector<double> sigmas;
  for (const YamlField& item : field.list(sigmas_expected)) sigmas.push_back(item.number(sigmas_expected));
  if (sigmas.size() != size) field.fail(field.value_text(), sigmas_expected);
  return sigmas;
}

Response parse_table(const YamlField& field) {
  expect_keys(field, {{}, {"light", "value"}});
  Response response{Response::Kind::table, 1, rising_from_0_to_1(field["light"]), rising_from_0_to_1(field["value"])};
  if (response.table_light.size() != response.table_value.size())
    field["value"].fail(field["value"].value_text(), "as many numbers as light has");
  if (const YamlField sigmas = field["sigma_light"]; sigmas.present())
    response.sigma_light = sigmas_like(sigmas, response.table_light.size());
  if (const YamlField sigmas = field["sigma_value"]; sigmas.present())
    response.sigma_value = sigmas_like(sigmas, response.table_value.size());
  return response;
}

// srgb where it is missing.
Response parse_response(const YamlField& field) {
  constexpr auto expected = "srgb, rec709, linear, gamma:VALUE with a value of 0.2 to 5, or a table of light and value";
  if (!field.present()) return {};
  if (field.is_map()) return parse_table(field);
  const std::string text = field.text(expected);
  if (text == "srgb") return {};
  if (text == "rec709") return {Response::Kind::rec709};
  if (text == "linear") return {Response::Kind::power, 1};
  constexpr std::string_view prefix = "gamma:";
  const auto gamma =
      text.starts_with(prefix) ? parse_finite(std::string_view(text).substr(prefix.size())) : std::nullopt;
  if (!gamma || *gamma < 0.2 || *gamma > 5) field.fail(text, expected);
  return {Response::Kind::power, *gamma};
}

ChromaticAberration parse_chromatic_aberration(const YamlField& field) {
  ChromaticAberration aberration;
  if (!field.present()) return aberration;
  expect_keys(field, {{"blue", "red"}, {}});
  const auto read = [&](const char* channel, double& magnification) {
    if (const YamlField given = field[channel]; given.present())
      magnification = given.number_between(0.98, 1.02, "0.98 to 1.02, times green's image");
  };
  read("blue", aberration.blue), read("red", aberration.red);
  return aberration;
}

CameraSigmas parse_camera_sigmas(const YamlField& camera) {
  CameraSigmas sigmas;
  if (const YamlField matrix = camera["sigma_camera_matrix"]; matrix.present()) {
    const auto k = parse_matrix<9>(matrix, 3, 3, sigmas_expected);
    sigmas.fx_px = k[0], sigmas.cx_px = k[2], sigmas.fy_px = k[4], sigmas.cy_px = k[5];
  }
  if (const YamlField distortion = camera["sigma_distortion_coefficients"]; distortion.present())
    sigmas.distortion = parse_distortion(distortion);
  if (const YamlField aberration = camera["sigma_lateral_chromatic_aberration"]; aberration.present()) {
    expect_keys(aberration, {{"blue", "red"}, {}});
    sigmas.blue = sigma_in(aberration, "blue").value_or(0), sigmas.red = sigma_in(aberration, "red").value_or(0);
  }
  return sigmas;
}

Camera parse_camera_fields(const YamlField& field) {
  expect_keys(field, {{"image_width", "image_height", "header", "camera_name", "distortion_model", "camera_model",
                       "rectification_matrix", "projection_matrix", "binning_x", "binning_y", "roi", "deinterlace",
                       "readout_s", "covariance"},
                      {"camera_matrix", "distortion_coefficients", "response", "lateral_chromatic_aberration"}});
  Camera camera;
  camera.width_px = parse_image_size(field["image_width"]);
  camera.height_px = parse_image_size(field["image_height"]);
  check_distortion_model(field);

  const auto k = parse_matrix<9>(field["camera_matrix"], 3, 3, "nine numbers, fx 0 cx 0 fy cy 0 0 1");
  const bool pinhole = k[0] > 0 && k[4] > 0 && k[1] == 0 && k[3] == 0 && k[6] == 0 && k[7] == 0 && k[8] == 1;
  const double least_px = 0.1 * camera.width_px;  // sees 157 degrees
  if (!pinhole || k[0] < least_px || k[4] < least_px || k[0] > 1e6 || k[4] > 1e6 || std::abs(k[2]) > 1e6 ||
      std::abs(k[5]) > 1e6) {
    std::ostringstream got;
    for (const double value : k) got << value << ' ';
    field["camera_matrix"]["data"].fail(
        got.str(), fmt::format("fx 0 cx 0 fy cy 0 0 1 with fx and fy in pixels, at least {:g}", least_px));
  }
  camera.fx_px = k[0], camera.cx_px = k[2], camera.fy_px = k[4], camera.cy_px = k[5];
  if (const YamlField coefficients = field["distortion_coefficients"]; coefficients.present()) {
    camera.distortion = parse_distortion(coefficients);
    // A marker where pixels have no ray would be seen and not understood.
    if (!is_invertible(camera))
      coefficients["data"].fail("not invertible within the largest circle amid the image",
                                "k1 k2 p1 p2 k3 of a calibration that covers it");
  }
  camera.response = parse_response(field["response"]);
  camera.response.sigma = sigma_in(field, "sigma_response");
  camera.chromatic_aberration = parse_chromatic_aberration(field["lateral_chromatic_aberration"]);
  if (const YamlField deinterlace = field["deinterlace"]; deinterlace.present())
    camera.deinterlace = deinterlace.boolean();
  if (const YamlField readout = field["readout_s"]; readout.present())
    camera.readout_s =
        readout.number_between(-Camera::longest_readout_s, Camera::longest_readout_s, "-0.1 to 0.1 (seconds)");
  camera.sigmas = parse_camera_sigmas(field);
  if (const YamlField covariance = field["covariance"]; covariance.present())
    camera.covariance = parse_covariance(covariance, 9, "81 numbers, a covariance of fx fy cx cy [px] k1 k2 p1 p2 k3");
  check_unused(field);
  return camera;
}

Camera parse_camera(const YamlField& field, const fs::path& folder) {
  if (!field.is_scalar()) return parse_camera_fields(field);
  return load_camera(folder / field.text("a map or the path of a camera file"));
}

MarkerSigmas parse_marker_sigmas(const YamlField& marker) {
  MarkerSigmas sigmas;
  sigmas.diameter_m = sigma_in(marker, "sigma_diameter_m");
  sigmas.hues_deg = sigmas_in<3>(marker, "sigma_hues_deg");
  sigmas.bands_upper_m = sigmas_in<3>(marker, "sigma_bands_upper_m");
  sigmas.bands_lower_m = sigmas_in<3>(marker, "sigma_bands_lower_m");
  sigmas.seam_rad = sigma_in(marker, "sigma_seam_rad");
  sigmas.wrap_m = sigma_in(marker, "sigma_wrap_m");
  sigmas.skew_m = sigma_in(marker, "sigma_skew_m");
  sigmas.gap_rad = sigma_in(marker, "sigma_gap_rad");
  sigmas.tolerance_m = sigma_in(marker, "sigma_tolerance_m");
  return sigmas;
}

Marker parse_marker(const YamlField& field) {
  expect_keys(field, {{},
                      {"diameter_m", "hues_deg", "bands_upper_m", "bands_lower_m", "seam_rad", "wrap_m", "skew_m",
                       "gap_rad", "tolerance_m"}});
  Marker marker;
  marker.diameter_m = field["diameter_m"].number("0.0005 to 0.1 (metres)");
  if (const YamlField hues = field["hues_deg"]; hues.present())
    marker.hues_deg = hues.numbers<3>("three hues in degrees");
  marker.bands_upper_m = field["bands_upper_m"].numbers<3>("three lengths in metres");
  marker.bands_lower_m = field["bands_lower_m"].numbers<3>("three lengths in metres");
  if (const YamlField seam = field["seam_rad"]; seam.present()) marker.seam_rad = seam.number("an angle in radians");
  if (const YamlField tolerance = field["tolerance_m"]; tolerance.present())
    marker.tolerance_m = tolerance.number_between(0, max_tolerance_m, "0 to 0.005 (metres)");
  if (const YamlField wrap = field["wrap_m"]; wrap.present()) marker.wrap_m = wrap.number("a length in metres");
  if (const YamlField skew = field["skew_m"]; skew.present()) marker.skew_m = skew.number("a length in metres");
  if (const YamlField gap = field["gap_rad"]; gap.present()) marker.gap_rad = gap.number("an angle in radians");
  marker.sigmas = parse_marker_sigmas(field);
  if (marker.sigmas.bands_upper_m.has_value() != marker.sigmas.bands_lower_m.has_value())
    field.fail("measured at one end alone", "sigma_bands_upper_m and sigma_bands_lower_m, both or neither");
  if (const auto problem = marker_problem(marker)) field.fail_within(*problem);
  if (const std::string problem = decoding_problem(marker); !problem.empty())
    field.fail("not decodable", "bands whose cross-ratio is monotonic over the rotation: " + problem);
  return marker;
}

Rigid3 parse_transform(const YamlField& field) {
  expect_keys(field, {{"covariance"}, {"translation_m", "quaternion_xyzw"}});
  const auto t = field["translation_m"].numbers<3>("x y z in metres", 10, "a length within 10 m");
  return {parse_unit_quaternion(field["quaternion_xyzw"]), {t[0], t[1], t[2]}};
}

// One that can head a column of our tables.
bool is_plain_name(const std::string& name) {
  return std::none_of(name.begin(), name.end(), [](char c) { return c == ',' || static_cast<unsigned char>(c) < ' '; });
}

Joints parse_joints(const YamlField& field) {
  expect_keys(field, {{"names", "sign"}, {"offset"}});
  constexpr auto four_names = "four different names, of theta, phi, rho and psi, without commas";
  Joints joints;
  const auto names = field["names"].list(four_names);
  if (names.size() != joints.names.size()) field["names"].fail(field["names"].value_text(), four_names);
  for (std::size_t i = 0; i < names.size(); ++i) {
    joints.names[i] = names[i].text(four_names);
    const bool repeated = std::ranges::count(joints.names, joints.names[i]) > 1;
    if (repeated || !is_plain_name(joints.names[i])) names[i].fail(joints.names[i], four_names);
  }
  const auto signs = field["sign"];
  joints.sign = signs.numbers<4>("four signs, 1 or -1");
  for (const double sign : joints.sign)
    if (std::abs(sign) != 1) signs.fail(std::to_string(sign), "1 or -1");
  joints.offset = field["offset"].numbers<4>("four numbers, rad rad m rad", 100, "an offset within 100 rad or m");
  // From a joint's reading to a configuration; psi's is known but for whole turns.
  JointUnits offsets = joint_positions;
  for (const std::size_t i : {0U, 1U, 2U}) offsets.most[i] *= 2;
  expect_radians_and_metres(field["offset"], joints.offset, offsets);
  joints.sigma_offset = sigmas_in<4>(field, "sigma_offset");
  return joints;
}

constexpr double max_length_m = 1, max_angle_rad = 6.2832;
constexpr auto metres = "metres within 1: larger numbers look like millimetres";
constexpr auto radians = "radians, at most a turn: larger numbers look like degrees";

Eigen::Vector3d point_in(const YamlField& field) {
  return Eigen::Vector3d(field.numbers<3>("x y z in metres", max_length_m, metres).data());
}
double length_in(const YamlField& map, const char* key) {
  const YamlField field = map[key];
  return field.present() ? field.number_between(-max_length_m, max_length_m, metres) : 0;
}
double angle_in(const YamlField& map, const char* key) {
  const YamlField field = map[key];
  return field.present() ? field.number_between(-max_angle_rad, max_angle_rad, radians) : 0;
}

// One for each joint of the wrist; none where the key is not there.
std::vector<double> angles_in(const YamlField& map, const char* key, std::size_t count) {
  const YamlField field = map[key];
  if (!field.present()) return {};
  const std::string expected = fmt::format("{} numbers, one for each joint of the wrist", count);
  std::vector<double> angles;
  for (const YamlField& item : field.list(expected))
    angles.push_back(item.number_between(-max_angle_rad, max_angle_rad, radians));
  if (angles.size() != count) field.fail(field.value_text(), expected);
  return angles;
}

WristJoint parse_joint(const YamlField& field) {
  expect_keys(field, {{"name", "alpha_rad", "a_m", "theta_rad", "d_m"}, {}});
  WristJoint joint;
  joint.name = field["name"].text("a joint's name");
  joint.alpha_rad = angle_in(field, "alpha_rad"), joint.theta_rad = angle_in(field, "theta_rad");
  joint.a_m = length_in(field, "a_m"), joint.d_m = length_in(field, "d_m");
  return joint;
}

Tool parse_wrist(const YamlField& field) {
  constexpr auto expected = "one to four joints of a wrist with different names";
  Tool tool;
  const auto fields = field["joints"].list(expected);
  if (fields.empty() || fields.size() > Tool::max_wrist_joints)
    field["joints"].fail(field["joints"].value_text(), expected);
  for (const YamlField& joint : fields) {
    tool.wrist.push_back(parse_joint(joint));
    const std::string name = tool.wrist.back().name;
    if (std::ranges::count(tool.wrist, name, &WristJoint::name) > 1) joint["name"].fail(name, expected);
  }
  if (const YamlField turn = field["tip_quaternion_xyzw"]; turn.present())
    tool.last_from_tip.rotation = parse_unit_quaternion(turn);
  if (const YamlField snake = field["snake_like"]; snake.present()) tool.snake_like = snake.boolean();
  return tool;
}

// By the sigmas beside the numbers, unless there is a covariance.
Tool::PlaceCovariance parse_place_covariance(const YamlField& field, const char* base_key, std::size_t wrist_joints) {
  Tool::PlaceCovariance covariance = Tool::PlaceCovariance::Zero();
  const int size = wrist_joints == 0 ? 3 : static_cast<int>(4 + wrist_joints);
  if (const YamlField given = field["covariance"]; given.present()) {
    const std::string expected =
        fmt::format("{} numbers, a covariance of x y z [m]{}", size * size,
                    wrist_joints == 0 ? "" : fmt::format(", azimuth_rad and {} numbers of offset_rad", wrist_joints));
    covariance.topLeftCorner(size, size) = parse_covariance(given, size, expected);
    return covariance;
  }
  Eigen::Matrix<double, Tool::PlaceCovariance::RowsAtCompileTime, 1> sigmas = decltype(sigmas)::Zero();
  if (const YamlField sigma = field[std::string("sigma_") + base_key]; sigma.present())
    sigmas.head<3>() = point_in(sigma);
  if (wrist_joints != 0) {
    sigmas[3] = angle_in(field, "sigma_azimuth_rad");
    std::ranges::copy(angles_in(field, "sigma_offset_rad", wrist_joints), sigmas.data() + 4);
  }
  covariance.diagonal() = sigmas.cwiseAbs2();
  return covariance;
}

Tool parse_straight(const YamlField& field) {
  constexpr auto key = "tip_in_marker_m";
  expect_keys(field, {{"covariance"}, {key}});
  Tool tool;
  tool.place.emplace().base_in_marker_m = point_in(field[key]);
  tool.place->covariance = parse_place_covariance(field, key, 0);
  return tool;
}

void parse_readings(const YamlField& field, Tool& tool) {
  const auto read = [&](const char* key, double WristJoint::*member) {
    const std::vector<double> angles = angles_in(field, key, tool.wrist.size());
    for (std::size_t i = 0; i < angles.size(); ++i) tool.wrist[i].*member = angles[i];
  };
  read("offset_rad", &WristJoint::offset_rad);
  read("sigma_reading_rad", &WristJoint::sigma_reading_rad);
  for (const WristJoint& joint : tool.wrist)
    if (joint.sigma_reading_rad < 0) field["sigma_reading_rad"].fail("below 0", sigmas_expected);
}

Tool parse_wristed(const YamlField& field, const fs::path& folder) {
  constexpr auto key = "wrist_in_marker_m";
  const bool has_file = field["file"].present();
  KnownKeys known{{"file", "tip_in_last_joint_m", "covariance", "sigma_reading_rad"},
                  {key, "azimuth_rad", "offset_rad"}};
  if (!has_file) known.words.insert(known.words.end(), {"joints", "tip_quaternion_xyzw", "snake_like"});
  expect_keys(field, known);
  Tool tool =
      has_file ? read_dvrk_tool(folder / field["file"].text("the path of a dVRK tool file")) : parse_wrist(field);
  if (const YamlField tip = field["tip_in_last_joint_m"]; !has_file || tip.present())
    tool.last_from_tip.translation = point_in(tip);
  parse_readings(field, tool);
  const bool placed = field[key].present();
  for (const char* other : {"azimuth_rad", "sigma_offset_rad", "covariance"})
    if (!placed && field[other].present()) field[other].fail("alone", std::string(key) + " beside it");
  if (!placed) return tool;
  const YamlField azimuth = field["azimuth_rad"];
  tool.place.emplace().base_in_marker_m = point_in(field[key]);
  tool.place->azimuth_rad = azimuth.number_between(-max_angle_rad, max_angle_rad, radians);
  tool.place->covariance = parse_place_covariance(field, key, tool.wrist.size());
  return tool;
}

Tool parse_tool(const YamlField& field, const fs::path& folder) {
  if (field.is_scalar()) return read_dvrk_tool(folder / field.text("the path of a dVRK tool file"));
  if (!field.is_map()) field.fail(field.value_text(), "the path of a dVRK tool file, or a map");
  return field["tip_in_marker_m"].present() ? parse_straight(field) : parse_wristed(field, folder);
}

Instrument parse_instrument(const YamlField& field, const fs::path& folder) {
  expect_keys(field, {{"name", "marker", "camera_from_rcm", "joints", "tool"}, {"image_delay_s"}});
  Instrument instrument;
  instrument.name = field["name"].text("a name");
  if (!is_plain_name(instrument.name))
    field["name"].fail(instrument.name, "a name without commas and control characters");
  instrument.marker = parse_marker(field["marker"]);
  if (const YamlField transform = field["camera_from_rcm"]; transform.present()) {
    instrument.camera_from_rcm = parse_transform(transform);
    instrument.sigma_translation_m = sigmas_in<3>(transform, "sigma_translation_m");
    instrument.sigma_quaternion_xyzw = sigmas_in<4>(transform, "sigma_quaternion_xyzw");
    if (const YamlField covariance = transform["covariance"]; covariance.present())
      instrument.registration_covariance =
          parse_covariance(covariance, 6, "36 numbers, a covariance of x y z [m] and rotations about x y z [rad]");
  }
  if (const YamlField joints = field["joints"]; joints.present()) instrument.joints = parse_joints(joints);
  if (const YamlField delay = field["image_delay_s"]; delay.present())
    instrument.image_delay_s = delay.number_between(-60, 60, "-60 to 60 (seconds)");
  if (const YamlField tool = field["tool"]; tool.present()) instrument.tool = parse_tool(tool, folder);
  instrument.sigma_image_delay_s = sigma_in(field, "sigma_image_delay_s");
  return instrument;
}

void check_distinguishable(const std::vector<Instrument>& instruments, const std::vector<YamlField>& fields) {
  for (std::size_t i = 0; i < instruments.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      if (instruments[i].name == instruments[j].name)
        fields[i]["name"].fail(instruments[i].name, "a name that no other instrument has");
      if (const auto problem = hues_problem(instruments[i].marker, instruments[j]))
        fields[i]["marker"]["hues_deg"].fail(problem->value, problem->expectation);
    }
}

Rig parse_root(const YamlField& root, const fs::path& folder) {
  if (root.is_map() && root["camera_matrix"].present() && !root["instruments"].present())
    root.fail("a camera file", "a rig file with instruments, whose camera may be the path of this file");
  expect_keys(root, {{"camera", "instruments"}, {}});
  Rig rig;
  const YamlField camera = root["camera"];
  rig.camera = parse_camera(camera, folder);
  if (camera.is_scalar()) rig.camera_file = folder / camera.text("a path");
  const YamlField list = root["instruments"];
  const auto fields = list.list("a list of instruments");
  if (fields.empty() || fields.size() > most_instruments) list.fail(list.value_text(), "one to eight instruments");
  for (const YamlField& field : fields) rig.instruments.push_back(parse_instrument(field, folder));
  check_distinguishable(rig.instruments, fields);
  return rig;
}

}  // namespace

Camera internal::load_camera(const fs::path& path) {
  return parse_camera_fields(YamlField::parse(with_rig_keys(read_yaml(path), path.string()), path.string(), file_kind));
}

Rig parse_rig(std::string_view yaml, const std::string& source, const fs::path& folder) {
  return parse_root(YamlField::parse(yaml, source, file_kind), folder);
}

Rig load_rig(const fs::path& path) {
  return parse_root(YamlField::read(path, file_kind), path.parent_path());
}

}  // namespace lapservo
