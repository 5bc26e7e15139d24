#include "lapservo/vision/shaft/shaft_pose.h"

#include <algorithm>
#include <cmath>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {

std::optional<double> facing_tau_rad(const Marker& marker, const ShaftPose& pose) {
  const auto view = view_cylinder(pose.camera_from_unrolled, marker.radius_m());
  if (!view) return std::nullopt;
  return wrap_two_pi(marker_azimuth_rad(marker, view->facing_azimuth_rad, pose.psi_rad));
}

ShaftPose pose_through_rcm(const Rigid3& camera_from_rcm, const JointVector& q) {
  return {camera_from_rcm * rcm_from_unrolled(q), q.psi_rad};
}

std::optional<JointVector> configuration_of(const ShaftPose& pose, const Rigid3& camera_from_rcm) {
  auto q = configuration_through(camera_from_rcm, pose.camera_from_unrolled);
  if (q) q->psi_rad += pose.psi_rad;
  return q;
}

PoseUnknowns::PoseUnknowns(const ShaftPose& pose, bool through_rcm)
    : pose_(pose), through_rcm_(through_rcm), axes_(pose.camera_from_unrolled.rotation.toRotationMatrix()) {}

UnknownVector PoseUnknowns::row(const Eigen::Vector3d& point_in_camera, const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d moment = (point_in_camera - pose_.camera_from_unrolled.translation).cross(direction);
  UnknownVector row = UnknownVector::Zero();
  row.head<2>() = axes_.leftCols<2>().transpose() * moment;
  row.segment<3>(2) = axes_.transpose() * direction;
  return row;
}

PoseUnknowns PoseUnknowns::changed_by(const PoseVector& step) const {
  const Eigen::Quaterniond tilt =
      Eigen::AngleAxisd(step[0], Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(step[1], Eigen::Vector3d::UnitY());
  ShaftPose moved = pose_;
  moved.camera_from_unrolled.translation += axes_ * step.segment<3>(2);
  moved.camera_from_unrolled.rotation = (pose_.camera_from_unrolled.rotation * tilt).normalized();
  moved.psi_rad += step[psi_unknown];
  return {moved, through_rcm_};
}

PoseVector PoseUnknowns::change_to(const PoseUnknowns& other) const {
  const Rigid3 &from = pose_.camera_from_unrolled, &to = other.pose_.camera_from_unrolled;
  const Eigen::Vector3d axis = from.rotation.conjugate() * (to.rotation * Eigen::Vector3d::UnitZ());
  PoseVector step;
  step << std::atan2(-axis.y(), axis.z()), std::asin(std::clamp(axis.x(), -1.0, 1.0)),
      axes_.transpose() * (to.translation - from.translation),
      wrap_pi(other.pose_.psi_rad - pose_.psi_rad + roll_between_rad(from.rotation, to.rotation));
  return step;
}

}  // namespace lapservo::internal
