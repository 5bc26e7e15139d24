#include "lapservo/tool/dvrk_tool_file.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {
namespace {

constexpr auto file_kind = "dVRK tool file";
constexpr double max_length_m = 1, max_angle_rad = 6.2832;

// JSON is YAML but for comments, which give way to blanks: a complaint's line stays the file's.
std::string without_comments(std::string_view json) {
  std::string text(json);
  bool quoted = false;
  for (std::size_t i = 0; i + 1 < text.size(); ++i) {
    if (text[i] == '"') quoted = !quoted;
    if (quoted && text[i] == '\\') ++i;
    if (quoted || text[i] != '/' || (text[i + 1] != '/' && text[i + 1] != '*')) continue;
    const bool block = text[i + 1] == '*';
    const std::size_t found = text.find(block ? "*/" : "\n", i + 2);
    const std::size_t end = found == std::string::npos ? text.size() : found + (block ? 2 : 0);
    for (; i < end; ++i)
      if (text[i] != '\n') text[i] = ' ';
    --i;
  }
  return text;
}

double angle_in(const YamlField& joint, const char* key) {
  const YamlField field = joint[key];
  return field.present() ? field.number_between(-max_angle_rad, max_angle_rad, "radians, at most a turn") : 0;
}
double length_in(const YamlField& joint, const char* key) {
  const YamlField field = joint[key];
  return field.present() ? field.number_between(-max_length_m, max_length_m, "metres, within 1") : 0;
}
void expect_word(const YamlField& map, const char* key, const char* word) {
  if (const YamlField field = map[key]; field.present() && field.text(word) != word)
    field.fail(field.value_text(), word);
}

// dVRK takes a right angle for exact in alpha, and in alpha only.
double alpha_in(const YamlField& joint) {
  const double alpha_rad = angle_in(joint, "alpha");
  return std::abs(alpha_rad) == 1.5708 ? std::copysign(std::numbers::pi / 2, alpha_rad) : alpha_rad;
}

WristJoint parse_joint(const YamlField& field) {
  expect_word(field, "type", "revolute");
  WristJoint joint;
  joint.name = field["name"].text("a joint's name");
  joint.alpha_rad = alpha_in(field);
  joint.a_m = length_in(field, "A"), joint.d_m = length_in(field, "D");
  joint.theta_rad = angle_in(field, "theta") + angle_in(field, "offset");
  return joint;
}

Rigid3 parse_tip(const YamlField& field) {
  constexpr auto expected = "four rows of four numbers, a rotation and a translation in metres";
  const auto rows = field.list(expected);
  if (rows.size() != 4) field.fail(field.value_text(), expected);
  Eigen::Matrix4d matrix;
  for (int i = 0; i < 4; ++i)
    matrix.row(i) = Eigen::RowVector4d(rows[i].numbers<4>(expected, max_length_m, "a number within 1").data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  constexpr double rounding = 1e-3;  // of four digits
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1) || !(rotation * rotation.transpose()).isIdentity(rounding) ||
      rotation.determinant() < 0)
    field.fail("no rotation and translation", expected);
  return {Eigen::Quaterniond(rotation).normalized(), matrix.topRightCorner<3, 1>()};
}

// Every file of dVRK's has one of the two: before 2.4 the one with a hyphen.
YamlField tip_field(const YamlField& root) {
  YamlField since_2_4 = root["tooltip_offset"], before = root["tooltip-offset"];
  if (!before.present()) return since_2_4;
  if (since_2_4.present()) before.fail("beside tooltip_offset", "one of the two: delete the other");
  return before;
}

// Those after the joint about the shaft's own axis, from whose frame a tool's place counts.
std::vector<WristJoint> parse_wrist(const YamlField& list) {
  constexpr auto expected = "roll about the shaft, then one to four joints of a wrist";
  const auto fields = list.list(expected);
  if (fields.size() < 2 || fields.size() > 1 + Tool::max_wrist_joints) list.fail(list.value_text(), expected);
  const WristJoint roll = parse_joint(fields.front());
  if (roll.alpha_rad != 0 || roll.a_m != 0) fields.front().fail("not about the shaft", expected);
  std::vector<WristJoint> wrist;
  for (auto field = fields.begin() + 1; field != fields.end(); ++field) {
    const std::string name = wrist.emplace_back(parse_joint(*field)).name;
    if (std::ranges::count(wrist, name, &WristJoint::name) > 1)
      (*field)["name"].fail(name, "a name that no other joint has");
  }
  return wrist;
}

}  // namespace

Tool parse_dvrk_tool(std::string_view json, const std::string& source) {
  const YamlField root = YamlField::parse(without_comments(json), source, file_kind);
  const YamlField dh = root["DH"];
  if (!root.is_map() || !dh.is_map()) dh.fail(dh.value_text(), "convention and joints, as dVRK's tool files have");
  expect_word(dh, "convention", "modified");
  Tool tool;
  tool.wrist = parse_wrist(dh["joints"]);
  tool.last_from_tip = parse_tip(tip_field(root));
  if (const YamlField snake = root["snake-like"]; snake.present()) tool.snake_like = snake.boolean();
  return tool;
}

Tool read_dvrk_tool(const std::filesystem::path& path) {
  Tool tool = parse_dvrk_tool(read_yaml(path), path.string());
  tool.file = path;
  return tool;
}

std::string axis_tip_text(const Tool& tool) {
  constexpr double least_m = 1e-3, jaw_m = 0.01;
  const auto& [rotation, tip_m] = tool.last_from_tip;
  if (tool.file.empty() || tool.wrist.empty() || tip_m.head<2>().norm() > least_m) return "";
  const Eigen::Vector3d end_m = (1e4 * (tip_m + jaw_m * (rotation * Eigen::Vector3d::UnitZ()))).array().round() / 1e4;
  return fmt::format(
      "the tip is the point on the axis of {}, where {} ends, and not the end of the jaw: for one that is 10 mm "
      "longer, the rig's tool needs tip_in_last_joint_m: [{:g}, {:g}, {:g}]",
      tool.wrist.back().name, tool.file.filename().string(), end_m.x() + 0.0, end_m.y() + 0.0, end_m.z() + 0.0);
}

}  // namespace lapservo::internal
