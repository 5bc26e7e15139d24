#pragma once

#include <Eigen/Geometry>

namespace lapservo::internal {

/// The shortest rotation that takes the direction `from` to that of `to`, neither zero; of opposite directions one of
/// many. Eigen's FromTwoVectors is a template around a singular value decomposition: each file that calls it compiles
/// one, for a minute under sanitizers.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// The rotation about a vector's direction by its length, and back: the vector of the shorter way, of at most pi.
Eigen::Quaterniond rotation_by(const Eigen::Vector3d& vector_rad);
Eigen::Vector3d rotation_vector_of(const Eigen::Quaterniond& rotation);

/// By how much a frame is turned about its z axis against another one whose z points nearly the same way.
double roll_between_rad(const Eigen::Quaterniond& from, const Eigen::Quaterniond& to);

}  // namespace lapservo::internal
