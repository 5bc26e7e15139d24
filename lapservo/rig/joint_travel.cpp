#include "lapservo/rig/joint_travel.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t rho = 2;

template <typename TextOf>
std::string for_each_joint(TextOf text_of) {
  return fmt::format("{}, {}, {}, {}", text_of(0), text_of(1), text_of(2), text_of(3));
}

}  // namespace

JointRanges ranges_of(const std::vector<std::array<double, 4>>& readings) {
  constexpr double wild = 0.01;
  JointRanges ranges;
  for (std::size_t j = 0; j < 4; ++j) {
    const auto of_joint = values_of(readings, [=](const auto& at) { return at[j]; });
    ranges.low[j] = quantile_of(of_joint, wild), ranges.high[j] = quantile_of(of_joint, 1 - wild);
  }
  return ranges;
}

std::string joint_text(std::size_t joint, double value) {
  return joint == rho ? fmt::format("{:.1f} mm", 1e3 * value) : fmt::format("{:.2f} rad", value);
}

std::string travels_text(const Joints& joints, const JointRanges& ranges) {
  return for_each_joint(
      [&](std::size_t j) { return joints.names[j] + " moved by " + joint_text(j, ranges.travel(j)); });
}

std::string ranges_text(const Joints& joints, const JointRanges& ranges) {
  return for_each_joint([&](std::size_t j) {
    const double low = j == rho ? 1e3 * ranges.low[j] : ranges.low[j];
    return fmt::format("{} {:.{}f} to {}", joints.names[j], low, j == rho ? 1 : 2, joint_text(j, ranges.high[j]));
  });
}

std::string still_joints(const Joints& joints, const JointRanges& ranges) {
  std::vector<std::string> still;
  for (std::size_t j = 0; j < 4; ++j)
    if (ranges.travel(j) < least_joint_travel[j])
      still.push_back(fmt::format("{} moved by {} only, at least {} show its sign and offset, better {}",
                                  joints.names[j], joint_text(j, ranges.travel(j)),
                                  joint_text(j, least_joint_travel[j]), joint_text(j, good_joint_travel[j])));
  return fmt::format("{}", fmt::join(still, "; "));
}

}  // namespace lapservo::internal
