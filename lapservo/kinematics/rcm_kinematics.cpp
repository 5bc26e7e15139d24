#include "lapservo/kinematics/rcm_kinematics.h"

#include <algorithm>
#include <cmath>

#include "lapservo/geometry/rotation.h"

namespace lapservo {

Eigen::Vector3d shaft_axis_in_rcm(const JointVector& q) {
  return {std::sin(q.phi_rad) * std::cos(q.theta_rad), std::sin(q.phi_rad) * std::sin(q.theta_rad),
          std::cos(q.phi_rad)};
}

Rigid3 rcm_from_unrolled(const JointVector& q) {
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(q.theta_rad, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(q.phi_rad, Eigen::Vector3d::UnitY());
  return {rotation, q.rho_m * shaft_axis_in_rcm(q)};
}

Rigid3 camera_from_marker(const Marker& marker, const Rigid3& camera_from_unrolled, double psi_rad) {
  const Eigen::AngleAxisd roll(psi_rad + marker.seam_rad, Eigen::Vector3d::UnitZ());
  return {(camera_from_unrolled.rotation * roll).normalized(), camera_from_unrolled.translation};
}

Rigid3 camera_from_marker(const Marker& marker, const Rigid3& camera_from_rcm, const JointVector& q) {
  return camera_from_marker(marker, camera_from_rcm * rcm_from_unrolled(q), q.psi_rad);
}

std::optional<JointVector> configuration_through(const Rigid3& camera_from_rcm,
                                                 const Eigen::Vector3d& proximal_end_in_camera) {
  const Eigen::Vector3d arm = camera_from_rcm.inverse() * proximal_end_in_camera;
  const double rho_m = arm.norm();
  if (!(rho_m > 1e-3)) return std::nullopt;
  return JointVector{std::atan2(arm.y(), arm.x()), std::acos(std::clamp(arm.z() / rho_m, -1.0, 1.0)), rho_m, 0};
}

std::optional<JointVector> configuration_through(const Rigid3& camera_from_rcm, const Rigid3& camera_from_shaft) {
  auto q = configuration_through(camera_from_rcm, camera_from_shaft.translation);
  if (!q) return std::nullopt;
  const Rigid3 unrolled = camera_from_rcm * rcm_from_unrolled(*q);
  q->psi_rad = internal::roll_between_rad(unrolled.rotation, camera_from_shaft.rotation);
  return q;
}

std::optional<JointVector> configuration_of_marker(const Marker& marker, const Rigid3& camera_from_rcm,
                                                   const Rigid3& seen_camera_from_marker) {
  auto q = configuration_through(camera_from_rcm, seen_camera_from_marker);
  if (q) q->psi_rad -= marker.seam_rad;
  return q;
}

}  // namespace lapservo
