#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include <Eigen/Core>

namespace lapservo {

/// The four degrees of freedom q of an instrument that pivots at its remote centre of motion (docs/frames.md,
/// "Frames and coordinates"): instrument rotation Rz(theta) Ry(phi) Rz(psi) in the RCM frame, and the distance rho
/// along the shaft from the RCM to the marker's proximal end. phi = 0 is singular. Also an arm's measured
/// joints, which are q but for what is wrong with them.
struct JointVector {
  double theta_rad = 0, phi_rad = 0, rho_m = 0, psi_rad = 0;

  static constexpr std::size_t size = 4;
  static constexpr std::array<std::string_view, size> names{"theta_rad", "phi_rad", "rho_m", "psi_rad"};

  Eigen::Vector4d vector() const { return {theta_rad, phi_rad, rho_m, psi_rad}; }
  static JointVector from_vector(const Eigen::Vector4d& q) { return {q[0], q[1], q[2], q[3]}; }
};

/// The image features f of eq. (11), on ideal pixels.
struct FeatureVector {
  double s_rad = 0;  ///< signed angle of the centre line from the image's vertical (eq. 12)
  double r_px = 0;   ///< from the projected RCM to e0 (eq. 13)
  double l_px = 0;   ///< from e0 to e3 (eq. 14)
  double d_px = 0;   ///< from e0 to e2 (eq. 15)

  static constexpr std::size_t size = 4;
  static constexpr std::array<std::string_view, size> names{"s_rad", "r_px", "l_px", "d_px"};

  Eigen::Vector4d vector() const { return {s_rad, r_px, l_px, d_px}; }
  static FeatureVector from_vector(const Eigen::Vector4d& f) { return {f[0], f[1], f[2], f[3]}; }
};

}  // namespace lapservo
