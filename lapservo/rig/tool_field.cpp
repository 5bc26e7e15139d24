#include "lapservo/rig/tool_field.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "lapservo/core/known_keys.h"
#include "lapservo/rig/matrix_field.h"
#include "lapservo/tool/dvrk_tool_file.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

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

// One for each joint of the wrist.
std::vector<double> angles_in(const YamlField& field, std::size_t count) {
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
    const auto has_its_name = [&](const WristJoint& other) { return other.name == tool.wrist.back().name; };
    if (std::find_if(tool.wrist.begin(), tool.wrist.end(), has_its_name) != tool.wrist.end() - 1)
      joint["name"].fail(tool.wrist.back().name, expected);
  }
  tool.last_from_tip.translation = point_in(field["tip_in_last_joint_m"]);
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
    if (const YamlField sigma = field["sigma_offset_rad"]; sigma.present()) {
      const std::vector<double> angles = angles_in(sigma, wrist_joints);
      std::copy(angles.begin(), angles.end(), sigmas.data() + 4);
    }
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
    if (const YamlField given = field[key]; given.present()) {
      const std::vector<double> angles = angles_in(given, tool.wrist.size());
      for (std::size_t i = 0; i < angles.size(); ++i) tool.wrist[i].*member = angles[i];
    }
  };
  read("offset_rad", &WristJoint::offset_rad);
  read("sigma_reading_rad", &WristJoint::sigma_reading_rad);
  for (const WristJoint& joint : tool.wrist)
    if (joint.sigma_reading_rad < 0) field["sigma_reading_rad"].fail("below 0", sigmas_expected);
}

Tool parse_wristed(const YamlField& field, const fs::path& folder) {
  constexpr auto key = "wrist_in_marker_m";
  const bool has_file = field["file"].present();
  KnownKeys known{{"file", "covariance", "sigma_reading_rad"}, {key, "azimuth_rad", "offset_rad"}};
  if (!has_file)
    known.words.insert(known.words.end(), {"joints", "tip_in_last_joint_m", "tip_quaternion_xyzw", "snake_like"});
  expect_keys(field, known);
  Tool tool =
      has_file ? read_dvrk_tool(folder / field["file"].text("the path of a dVRK tool file")) : parse_wrist(field);
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

}  // namespace

Tool parse_tool(const YamlField& field, const fs::path& folder) {
  if (field.is_scalar()) return read_dvrk_tool(folder / field.text("the path of a dVRK tool file"));
  if (!field.is_map()) field.fail(field.value_text(), "the path of a dVRK tool file, or a map");
  return field["tip_in_marker_m"].present() ? parse_straight(field) : parse_wristed(field, folder);
}

}  // namespace lapservo::internal
