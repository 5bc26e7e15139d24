#include "lapservo/rig/joint_conversion.h"

namespace lapservo::internal {
namespace {

Eigen::Vector4d vector_of(const std::array<double, 4>& values) {
  return Eigen::Vector4d(values.data());
}

}  // namespace

Eigen::Vector4d q_from_joints(const Joints& joints, const Eigen::Vector4d& positions) {
  return vector_of(joints.sign).cwiseProduct(positions) + vector_of(joints.offset);
}

Eigen::Vector4d joints_from_q(const Joints& joints, const Eigen::Vector4d& q) {
  return vector_of(joints.sign).cwiseProduct(q - vector_of(joints.offset));
}

}  // namespace lapservo::internal
