#include "lapservo/vision/shaft/shaft_pose.h"

#include <cmath>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {

std::optional<double> facing_tau_rad(const Marker& marker, const ShaftPose& pose) {
  const auto view = view_cylinder(pose.camera_from_unrolled, marker.radius_m());
  if (!view) return std::nullopt;
  return wrap_two_pi(marker_azimuth_rad(marker, view->facing_azimuth_rad, pose.psi_rad));
}

std::optional<JointVector> configuration_of(const ShaftPose& pose, const Rigid3& camera_from_rcm) {
  auto q = configuration_through(camera_from_rcm, pose.camera_from_unrolled.translation);
  if (!q) return std::nullopt;
  const Rigid3 through_rcm = camera_from_rcm * rcm_from_unrolled(*q);
  const Eigen::Matrix3d roll =
      (through_rcm.rotation.conjugate() * pose.camera_from_unrolled.rotation).toRotationMatrix();
  q->psi_rad = pose.psi_rad + std::atan2(roll(1, 0) - roll(0, 1), roll(0, 0) + roll(1, 1));
  return q;
}

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
  if (camera_from_rcm_) {
    pose_ = {*camera_from_rcm_ * rcm_from_unrolled(*q_), q_->psi_rad};
    pivot_ = camera_from_rcm_->translation;
    rotations_[0] = camera_from_rcm_->rotation * Eigen::Vector3d::UnitZ();              // theta
    rotations_[1] = pose_.camera_from_unrolled.rotation * Eigen::Vector3d::UnitY();     // phi
    translations_[0] = pose_.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();  // rho
    return;
  }
  pivot_ = pose_.camera_from_unrolled.translation;
  const Eigen::Matrix3d axes = pose_.camera_from_unrolled.rotation.toRotationMatrix();
  rotations_ = {axes.col(0), axes.col(1)};
  translations_ = {axes.col(0), axes.col(1), axes.col(2)};
}

UnknownVector PoseUnknowns::row(const Eigen::Vector3d& point_in_camera, const Eigen::Vector3d& direction,
                                int beyond) const {
  UnknownVector row = UnknownVector::Zero(size() + beyond);
  const Eigen::Vector3d moment = (point_in_camera - pivot_).cross(direction);
  row[0] = rotations_[0].dot(moment), row[1] = rotations_[1].dot(moment);
  row[2] = translations_[0].dot(direction);
  if (!camera_from_rcm_) row[3] = translations_[1].dot(direction), row[4] = translations_[2].dot(direction);
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
