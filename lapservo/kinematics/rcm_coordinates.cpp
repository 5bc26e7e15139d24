#include "lapservo/kinematics/rcm_coordinates.h"

#include <cmath>

namespace lapservo {

Eigen::Vector3d shaft_axis_in_rcm(const RcmCoordinates& q) {
  return {std::sin(q.phi_rad) * std::cos(q.theta_rad), std::sin(q.phi_rad) * std::sin(q.theta_rad),
          std::cos(q.phi_rad)};
}

Rigid3 rcm_from_unrolled(const RcmCoordinates& q) {
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(q.theta_rad, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(q.phi_rad, Eigen::Vector3d::UnitY());
  return {rotation, q.rho_m * shaft_axis_in_rcm(q)};
}

}  // namespace lapservo
