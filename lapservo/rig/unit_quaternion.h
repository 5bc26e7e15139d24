#pragma once

#include <Eigen/Geometry>

#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {

inline constexpr double rotation_tolerance = 2e-4;  ///< what four typed digits leave

/// x y z w. Throws InputError for one that is not of unit norm, to rotation_tolerance.
Eigen::Quaterniond parse_unit_quaternion(const YamlField& field);

}  // namespace lapservo::internal
