#include "lapservo/crtk/joint_map.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/printable.h"

namespace lapservo::internal {
namespace {

using Names = decltype(Joints::names);

// A dVRK PSM's, from 2.3 on and before.
const std::array<Names, 2> dvrk_names{
    {{"yaw", "pitch", "insertion", "roll"}, {"outer_yaw", "outer_pitch", "outer_insertion", "outer_roll"}}};

std::optional<Names> other_names(const Joints& joints) {
  for (std::size_t i = 0; i < dvrk_names.size(); ++i)
    if (joints.names == dvrk_names[i]) return dvrk_names[1 - i];
  return std::nullopt;
}

std::string repeated_of(const Names& wanted, const std::vector<std::string>& names) {
  const auto found = std::find_if(wanted.begin(), wanted.end(), [&](const std::string& name) {
    return std::count(names.begin(), names.end(), name) > 1;
  });
  return found == wanted.end() ? "" : *found;
}

std::optional<std::array<std::size_t, 4>> find_names(const Names& wanted, const std::vector<std::string>& names) {
  std::array<std::size_t, 4> places{};
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto found = std::find(names.begin(), names.end(), wanted[i]);
    if (found == names.end() || std::find(found + 1, names.end(), wanted[i]) != names.end()) return std::nullopt;
    places[i] = static_cast<std::size_t>(found - names.begin());
  }
  return places;
}

// A PSM without an instrument: the discs of the sterile adapter are joints, by the names of the instrument's or not.
// The first that says so; empty where none does.
std::string joint_of_no_tool(const std::vector<std::string>& names) {
  const auto found = std::find_if(names.begin(), names.end(),
                                  [](const std::string& name) { return name.rfind("disc", 0) == 0 || name == "jaw"; });
  return found == names.end() ? "" : *found;
}

}  // namespace

JointLimits limits_of_q(const Joints& joints, const JointLimits& limits) {
  const Eigen::Vector4d a = q_from_joints(joints, limits.lower), b = q_from_joints(joints, limits.upper);
  JointLimits of_q = limits;
  of_q.lower = a.cwiseMin(b);
  of_q.upper = a.cwiseMax(b);
  return of_q;
}

std::optional<std::array<std::size_t, 4>> find_joints(const Joints& joints, const std::vector<std::string>& names) {
  const auto other = other_names(joints);
  if (other && !joint_of_no_tool(names).empty()) return std::nullopt;
  if (const auto places = find_names(joints.names, names)) return places;
  return other ? find_names(*other, names) : std::nullopt;
}

bool is_same_joint(std::string_view a, std::string_view b) {
  constexpr std::string_view before = "outer_";
  for (std::string_view* name : {&a, &b})
    if (name->starts_with(before)) name->remove_prefix(before.size());
  return a == b;
}

std::vector<double> wrist_in(const JointMessage& message, const std::vector<std::string>& names) {
  std::vector<double> positions;
  for (const std::string& name : names) {
    const auto is_it = [&](const std::string& other) { return is_same_joint(other, name); };
    if (std::count_if(message.names.begin(), message.names.end(), is_it) != 1) return {};
    const auto found = std::find_if(message.names.begin(), message.names.end(), is_it);
    positions.push_back(message.positions[static_cast<std::size_t>(found - message.names.begin())]);
  }
  return positions;
}

std::string repeated_joint(const Joints& joints, const std::vector<std::string>& names) {
  const std::string repeated = repeated_of(joints.names, names);
  const auto other = other_names(joints);
  return repeated.empty() && other ? repeated_of(*other, names) : repeated;
}

std::string unfit_joints(const Joints& joints, const std::vector<std::string>& names) {
  if (const std::string twice = repeated_joint(joints, names); !twice.empty())
    return fmt::format("has the joints {}: {} stands there twice, expected each name once", printable_names(names),
                       printable(twice));
  if (names.empty()) return "names no joints: enable and home the arm";
  const auto other = other_names(joints);
  const std::string no_tool = other ? joint_of_no_tool(names) : "";
  return fmt::format("has the joints {}, expected {}{}{}", printable_names(names), fmt::join(joints.names, ", "),
                     other ? fmt::format(" or {}", fmt::join(*other, ", ")) : "",
                     no_tool.empty()
                         ? ""
                         : fmt::format(" without {}. A dVRK's arm has it while it knows no instrument: name that on "
                                       "set_tool_type; another arm publishes its jaw on jaw/measured_js",
                                       printable(no_tool)));
}

}  // namespace lapservo::internal
