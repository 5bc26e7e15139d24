#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// By how much each joint has to move at least for its sign and offset to show, and by how much it should: theta, phi,
/// rho, psi in rad, rad, m, rad.
inline constexpr std::array<double, 4> least_joint_travel{0.1, 0.1, 5e-3, 0.2}, good_joint_travel{0.5, 0.5, 0.02, 2};

/// Between which readings each of the four joints moved, in rad and m.
struct JointRanges {
  std::array<double, 4> low{}, high{};

  double travel(std::size_t joint) const { return high[joint] - low[joint]; }
};

/// Ranges of at least one row of readings, without the hundredth at either end, which may hold outliers.
JointRanges ranges_of(const std::vector<std::array<double, 4>>& readings);

/// A joint's length or angle with its unit: "0.12 rad", "5.0 mm".
std::string joint_text(std::size_t joint, double value);

/// By how much each joint moved.
std::string travels_text(const Joints& joints, const JointRanges& ranges);

/// Between which readings each joint moved.
std::string ranges_text(const Joints& joints, const JointRanges& ranges);

/// Names the joints that moved by less than least_joint_travel, and how far they have to; empty when there is none.
std::string still_joints(const Joints& joints, const JointRanges& ranges);

}  // namespace lapservo::internal
