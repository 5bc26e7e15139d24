#include "lapservo/kinematics/tip_kinematics.h"

#include <cmath>

#include "lapservo/core/angles.h"

namespace lapservo::internal {

std::optional<JointVector> configuration_of_tip(const Rigid3& camera_from_rcm, const Marker& marker,
                                                const Eigen::Vector3d& tip_in_marker_m,
                                                const Eigen::Vector3d& tip_in_camera_m, double psi_rad) {
  const Eigen::Vector3d tip_in_rcm = camera_from_rcm.inverse() * tip_in_camera_m;
  const Eigen::Vector3d tip =
      Eigen::AngleAxisd(psi_rad + marker.seam_rad, Eigen::Vector3d::UnitZ()) * tip_in_marker_m;  // unrolled axes
  const double along_m = std::sqrt(tip_in_rcm.squaredNorm() - tip.head<2>().squaredNorm());      // from the RCM
  // Ry(phi) lifts (tip.x, along) to the height of the place, Rz(theta) turns it there.
  const double cosine = tip_in_rcm.z() / std::hypot(tip.x(), along_m);
  if (!(std::abs(cosine) <= 1)) return std::nullopt;
  JointVector q;
  q.phi_rad = std::acos(cosine) - std::atan2(tip.x(), along_m);
  const double x_m = std::cos(q.phi_rad) * tip.x() + std::sin(q.phi_rad) * along_m;
  q.theta_rad = wrap_pi(std::atan2(tip_in_rcm.y(), tip_in_rcm.x()) - std::atan2(tip.y(), x_m));
  q.rho_m = along_m - tip.z();
  q.psi_rad = psi_rad;
  if (!q.vector().allFinite() || !(q.rho_m > 1e-3)) return std::nullopt;
  return q;
}

std::optional<JointVector> configuration_of_tip(const Rigid3& camera_from_rcm, const Marker& marker,
                                                const Rigid3& marker_from_tip, const Eigen::Vector3d& tip_in_camera_m,
                                                const Eigen::Quaterniond& camera_from_tip) {
  // A tip beside the axis moves theta and phi with psi, by the little that it lies beside it.
  constexpr int enough = 20;
  constexpr double settled_rad = 1e-12;
  double psi_rad = 0;
  std::optional<JointVector> q;
  for (int i = 0; i < enough; ++i) {
    q = configuration_of_tip(camera_from_rcm, marker, marker_from_tip.translation, tip_in_camera_m, psi_rad);
    if (!q) return std::nullopt;
    const Eigen::Matrix3d to_turn = (camera_from_marker(marker, camera_from_rcm, *q).rotation.conjugate() *
                                     camera_from_tip * marker_from_tip.rotation.conjugate())
                                        .toRotationMatrix();
    const double turn_rad = std::atan2(to_turn(1, 0) - to_turn(0, 1), to_turn(0, 0) + to_turn(1, 1));
    if (!(std::abs(turn_rad) > settled_rad)) break;
    psi_rad = wrap_pi(psi_rad + turn_rad);
  }
  return q;
}

}  // namespace lapservo::internal
