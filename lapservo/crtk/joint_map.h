#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "lapservo/control/controller_config.h"
#include "lapservo/crtk/messages.h"
#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {

inline bool all_finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

/// Bounds of q from bounds of the arm's joints.
JointLimits limits_of_q(const Joints& joints, const JointLimits& limits);

/// Where the four joints stand in a message with these names. nullopt when one is missing or stands there twice. Where
/// the rig has a dVRK PSM's names, of either 2.3 and later or before, the others count, too, and none where the names
/// are those of a PSM without an instrument.
std::optional<std::array<std::size_t, 4>> find_joints(const Joints& joints, const std::vector<std::string>& names);

/// Whether two names are one joint's, by dVRK's of 2.3 and later or before: wrist_yaw, outer_wrist_yaw.
bool is_same_joint(std::string_view a, std::string_view b);

/// A message's positions of the joints with these names, by dVRK's of 2.3 and later or before, in their order. Empty
/// when one is missing or stands there twice.
std::vector<double> wrist_in(const JointMessage& message, const std::vector<std::string>& names);

/// The first of the rig's joints, by either of a PSM's names, that stands in a message twice; empty where none does.
std::string repeated_joint(const Joints& joints, const std::vector<std::string>& names);

/// Why it finds none: the names that came and those that are expected, after the topic's name.
std::string unfit_joints(const Joints& joints, const std::vector<std::string>& names);

}  // namespace lapservo::internal
