#pragma once

#include <string_view>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "lapservo/core/yaml_field.h"

namespace lapservo::internal {

/// Throws InputError where the `rows` or `cols` of a ROS matrix, if they are there, are others.
void check_shape(const YamlField& field, int rows, int columns);

/// A covariance of size x size numbers: `rows`, `cols` and `data`, as ROS writes matrices. Throws InputError for
/// another size, and where it is not symmetric or has a negative variance in some direction.
Eigen::MatrixXd parse_covariance(const YamlField& field, int size, std::string_view expected);

inline constexpr double rotation_tolerance = 2e-4;  ///< what four typed digits leave

/// x y z w. Throws InputError for one that is not of unit norm, to rotation_tolerance.
Eigen::Quaterniond parse_unit_quaternion(const YamlField& field);

}  // namespace lapservo::internal
