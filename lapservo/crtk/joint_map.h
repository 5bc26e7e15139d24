#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// theta, phi, rho, psi of the arm's four joints, in the order of Joints::names, and back: q_i = sign_i * joint_i +
/// offset_i.
Eigen::Vector4d q_from_joints(const Joints& joints, const Eigen::Vector4d& positions);
Eigen::Vector4d joints_from_q(const Joints& joints, const Eigen::Vector4d& q);

/// Bounds of q from bounds of the arm's joints.
JointLimits limits_of_q(const Joints& joints, const JointLimits& limits);

/// Where the four joints stand in a message with these names. nullopt when one is missing or stands there twice.
std::optional<std::array<std::size_t, 4>> find_joints(const Joints& joints, const std::vector<std::string>& names);

}  // namespace lapservo::internal
