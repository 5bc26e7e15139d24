#pragma once

#include <Eigen/Core>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// theta, phi, rho, psi of the arm's four joints, in the order of Joints::names, and back: q_i = sign_i * joint_i +
/// offset_i.
inline Eigen::Vector4d q_from_joints(const Joints& joints, const Eigen::Vector4d& positions) {
  return Eigen::Vector4d(joints.sign.data()).cwiseProduct(positions) + Eigen::Vector4d(joints.offset.data());
}
inline Eigen::Vector4d joints_from_q(const Joints& joints, const Eigen::Vector4d& q) {
  return Eigen::Vector4d(joints.sign.data()).cwiseProduct(q - Eigen::Vector4d(joints.offset.data()));
}

}  // namespace lapservo::internal
