#include "lapservo/vision/shaft_pose.h"

#include <cmath>
#include <cstddef>

namespace lapservo::internal {

PoseUnknowns PoseUnknowns::rcm(const Rigid3& camera_from_rcm, const JointVector& q) {
  PoseUnknowns unknowns;
  unknowns.camera_from_rcm_ = camera_from_rcm;
  unknowns.q_ = q;
  unknowns.derive();
  return unknowns;
}

PoseUnknowns PoseUnknowns::free(const ShaftPose& pose) {
  PoseUnknowns unknowns;
  unknowns.pose_ = pose;
  unknowns.derive();
  return unknowns;
}

void PoseUnknowns::derive() {
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  if (camera_from_rcm_) {
    pose_ = {*camera_from_rcm_ * rcm_from_unrolled(*q_), q_->psi_rad};
    pivot_ = camera_from_rcm_->translation;
    const Eigen::Vector3d theta_axis = camera_from_rcm_->rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d phi_axis = pose_.camera_from_unrolled.rotation * Eigen::Vector3d::UnitY();
    const Eigen::Vector3d shaft_axis = pose_.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
    twists_[0] = {theta_axis, zero}, twists_[1] = {phi_axis, zero}, twists_[2] = {zero, shaft_axis};
    return;
  }
  pivot_ = pose_.camera_from_unrolled.translation;
  const Eigen::Matrix3d axes = pose_.camera_from_unrolled.rotation.toRotationMatrix();
  twists_[0] = {axes.col(0), zero}, twists_[1] = {axes.col(1), zero};
  for (int i = 0; i < 3; ++i) twists_[static_cast<std::size_t>(2 + i)] = {zero, axes.col(i)};
}

UnknownVector PoseUnknowns::row(const Eigen::Vector3d& point_in_camera, const Eigen::Vector3d& direction) const {
  UnknownVector row = UnknownVector::Zero(size());
  const Eigen::Vector3d moment = (point_in_camera - pivot_).cross(direction);
  for (int i = 0; i + 1 < size(); ++i) {
    const Twist& twist = twists_[static_cast<std::size_t>(i)];
    row[i] = twist.angular.dot(moment) + twist.linear.dot(direction);
  }
  return row;
}

PoseUnknowns PoseUnknowns::changed_by(const UnknownVector& step) const {
  if (camera_from_rcm_) return rcm(*camera_from_rcm_, JointVector::from_vector(q_->vector() + step));
  const Eigen::Quaterniond tilt =
      Eigen::AngleAxisd(step[0], Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(step[1], Eigen::Vector3d::UnitY());
  ShaftPose moved = pose_;
  moved.camera_from_unrolled.translation += pose_.camera_from_unrolled.rotation * step.segment<3>(2);
  moved.camera_from_unrolled.rotation = (pose_.camera_from_unrolled.rotation * tilt).normalized();
  moved.psi_rad += step[5];
  return free(moved);
}

PoseUnknowns PoseUnknowns::with_psi(double psi_rad) const {
  if (!camera_from_rcm_) return free({pose_.camera_from_unrolled, psi_rad});
  JointVector q = *q_;
  q.psi_rad = psi_rad;
  return rcm(*camera_from_rcm_, q);
}

}  // namespace lapservo::internal
