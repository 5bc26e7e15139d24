#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/marker/marker.h"

namespace lapservo {

/// The marker on the centre line: the images of e0..e3 on the facing generatrix, where the plane through the shaft's
/// axis and the camera centre meets the surface (docs/conventions.md, "What the centre line shows").
struct CentreLine {
  double facing_azimuth_rad;  ///< gamma, in the unrolled frame
  double tau_rad;             ///< gamma - psi - seam, in [0, 2 pi)
  std::array<Eigen::Vector3d, 4> points_in_camera_m;
  std::array<Eigen::Vector2d, 4> ideal_px;
};

/// nullopt when the camera centre lies inside the shaft or a point behind the camera.
std::optional<CentreLine> centre_line(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled,
                                      double psi_rad);

/// Image features on ideal pixels (eq. 12-15). `r_px` is NaN-free: absent when the RCM's image is unknown.
struct Features {
  double s_rad = 0;            ///< atan2(du, dv) of e3 - e0: the signed angle from the image's vertical
  std::optional<double> r_px;  ///< |e0 - o|, o the projected RCM
  double l_px = 0;             ///< |e3 - e0|
  double d_px = 0;             ///< |e2 - e0|
  double cross_ratio = 0;      ///< of |e1 - e0|, |e2 - e1|, |e3 - e2|
};

Features features_of(const std::array<Eigen::Vector2d, 4>& edges_ideal_px,
                     const std::optional<Eigen::Vector2d>& rcm_ideal_px);

/// Of four points as one vector, e0 u, v to e3 u, v [px^2].
using EdgesCovariance = Eigen::Matrix<double, 8, 8>;

/// Covariance of s_rad, r_px, l_px, d_px, to first order, of points with that covariance. r's row and column are zero
/// where the RCM's image is unknown; where it is known, it counts as exact.
Eigen::Matrix4d features_covariance(const std::array<Eigen::Vector2d, 4>& edges_ideal_px,
                                    const EdgesCovariance& covariance_px2,
                                    const std::optional<Eigen::Vector2d>& rcm_ideal_px);

/// Image of the RCM; algebraic (mirrored) when it lies behind the camera, nullopt when in its focal plane.
std::optional<Eigen::Vector2d> projected_rcm_px(const Camera& camera, const Rigid3& camera_from_rcm);

}  // namespace lapservo
