#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/rigid3.h"

namespace lapservo {

/// The four degrees of freedom of an instrument that pivots at its remote centre of motion (CONVENTIONS "Frames and
/// coordinates"): instrument rotation Rz(theta) Ry(phi) Rz(psi) in the RCM frame, and the distance rho along the shaft
/// from the RCM to the marker's proximal end. phi = 0 is singular.
struct RcmCoordinates {
  double theta_rad = 0, phi_rad = 0, rho_m = 0, psi_rad = 0;

  Eigen::Vector4d vector() const { return {theta_rad, phi_rad, rho_m, psi_rad}; }
  static RcmCoordinates from_vector(const Eigen::Vector4d& q) { return {q[0], q[1], q[2], q[3]}; }
};

/// Shaft axis in the RCM frame, from the RCM towards the tip.
Eigen::Vector3d shaft_axis_in_rcm(const RcmCoordinates& q);

/// The unrolled frame Rz(theta) Ry(phi), moved along the axis to the marker's proximal end: azimuths about the shaft
/// are measured in it, and points of the marker have z from 0 to its length.
Rigid3 rcm_from_unrolled(const RcmCoordinates& q);

/// The configuration (psi = 0) of a shaft through the RCM whose marker begins at a point; nullopt at the RCM itself.
std::optional<RcmCoordinates> configuration_through(const Rigid3& camera_from_rcm,
                                                    const Eigen::Vector3d& proximal_end_in_camera);

}  // namespace lapservo
