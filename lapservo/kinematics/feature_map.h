#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// All that decides how one instrument's configuration appears in the image.
struct ImageModel {
  Camera camera;  ///< features live on ideal pixels: distortion plays no part
  Marker marker;
  Rigid3 camera_from_rcm;
};

/// f(q) = [s_rad r_px l_px d_px] and what belongs to it.
struct FeaturePoint {
  Eigen::Vector4d f = Eigen::Vector4d::Zero();
  /// df/dq for q = [theta phi rho psi] (eq. 20): rows s (rad), r, l, d (px) by columns rad, rad, m, rad.
  Eigen::Matrix4d jacobian = Eigen::Matrix4d::Zero();
  /// d(u, v of e0, u, v of e3)/dq, px by the same columns: what keeps the marker within the image.
  Eigen::Matrix4d ends_jacobian = Eigen::Matrix4d::Zero();
  double tau_rad = 0;  ///< marker azimuth on the centre line, [0, 2 pi)
  std::array<Eigen::Vector2d, 4> ideal_px{};
};

/// The feature map (eq. 12-15) with its analytic Jacobian (eq. 20), for surface points on the facing generatrix where
/// the paper takes points of the axis: gamma moves with theta and phi, so the line on the surface, the azimuth
/// tau = gamma - psi - seam on the marker and with it the inner boundaries move too. Neither depends on rho.
///
/// d jumps where tau passes the seam (0 = 2 pi), by the difference between the print's upper and lower edge. There the
/// Jacobian is the one-sided derivative of the side that wrap_two_pi puts tau on (tau = 0: the upper edge).
///
/// Every number is finite. Nullopt where q is not finite, the RCM has no image, the camera centre lies in the extended
/// shaft, a boundary of the marker is not in front of the camera, e0 coincides in the image with e3 or e2 (s has no
/// value) or with the projected RCM (r has a kink).
std::optional<FeaturePoint> feature_map(const ImageModel& model, const JointVector& q);

}  // namespace lapservo::internal
