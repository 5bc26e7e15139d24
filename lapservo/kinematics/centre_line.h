#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/kinematics/features.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// The marker on the centre line: the images of e0..e3 on the facing generatrix, where the plane through the shaft's
/// axis and the camera centre meets the surface (docs/frames.md, "Centre line").
struct CentreLine {
  double facing_azimuth_rad;  ///< gamma, in the unrolled frame
  double tau_rad;             ///< gamma - psi - seam, in [0, 2 pi)
  std::array<Eigen::Vector3d, 4> points_in_camera_m;
  std::array<Eigen::Vector2d, 4> ideal_px;
};

/// nullopt when the camera centre lies inside the shaft or a point behind the camera.
std::optional<CentreLine> centre_line(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled,
                                      double psi_rad);

/// `r_px` is absent when the RCM's image is unknown.
Features features_of(const std::array<Eigen::Vector2d, 4>& edges_ideal_px,
                     const std::optional<Eigen::Vector2d>& rcm_ideal_px);

/// Covariance of s_rad, r_px, l_px, d_px, to first order, of points with that covariance. r's row and column are zero
/// where the RCM's image is unknown; where it is known, it has `rcm_covariance_px2`, independently of the points.
/// Whoever compares r with a model of the same RCM leaves that out: its error is in both.
Eigen::Matrix4d features_covariance(const std::array<Eigen::Vector2d, 4>& edges_ideal_px,
                                    const EdgesCovariance& covariance_px2,
                                    const std::optional<Eigen::Vector2d>& rcm_ideal_px,
                                    const Eigen::Matrix2d& rcm_covariance_px2 = Eigen::Matrix2d::Zero());

/// Image of the RCM; algebraic (mirrored) when it lies behind the camera, nullopt when in its focal plane.
std::optional<Eigen::Vector2d> projected_rcm_px(const Camera& camera, const Rigid3& camera_from_rcm);

/// Covariance of that image, to first order: by what the camera's sigmas say of its matrix, and by the covariance of
/// the RCM's place in the camera frame. Not for an RCM in the focal plane.
Eigen::Matrix2d projected_rcm_covariance_px2(const Camera& camera, const Rigid3& camera_from_rcm,
                                             const Eigen::Matrix3d& place_covariance_m2);

}  // namespace lapservo::internal
