#pragma once

#include <filesystem>

#include "lapservo/control/controller_config.h"

namespace lapservo::internal {

/// Reads an arm's limits from YAML (configs/joint_limits/psm-classic.yaml): `lower`, `upper`, `rate`, `acceleration`,
/// four numbers each, of the joints in the order of the rig's `joints` entry; rad, m, rad/s, m/s, rad/s^2, m/s^2.
/// Throws InputError naming file, field, value and expectation.
JointLimits load_arm_limits(const std::filesystem::path& path);

}  // namespace lapservo::internal
