#include "lapservo/kinematics/centre_line.h"

#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/cylinder.h"
#include "lapservo/marker/azimuths.h"

namespace lapservo::internal {

std::optional<CentreLine> centre_line(const Camera& camera, const Marker& marker, const Rigid3& camera_from_unrolled,
                                      double psi_rad) {
  const auto view = view_cylinder(camera_from_unrolled, marker.radius_m());
  if (!view) return std::nullopt;
  CentreLine line;
  line.facing_azimuth_rad = view->facing_azimuth_rad;
  line.tau_rad = wrap_two_pi(marker_azimuth_rad(marker, view->facing_azimuth_rad, psi_rad));
  const auto along_m = boundaries_m(marker, line.tau_rad);
  for (std::size_t k = 0; k < 4; ++k) {
    line.points_in_camera_m[k] =
        camera_from_unrolled * surface_point(marker.radius_m(), view->facing_azimuth_rad, along_m[k]);
    if (!(line.points_in_camera_m[k].z() > 1e-6)) return std::nullopt;
    line.ideal_px[k] = camera.ideal_from_point(line.points_in_camera_m[k]);
  }
  return line;
}

Features features_of(const std::array<Eigen::Vector2d, 4>& e, const std::optional<Eigen::Vector2d>& rcm_ideal_px) {
  const Eigen::Vector2d whole = e[3] - e[0];
  Features f;
  f.s_rad = std::atan2(whole.x(), whole.y());
  if (rcm_ideal_px) f.r_px = (e[0] - *rcm_ideal_px).norm();
  f.l_px = whole.norm();
  f.d_px = (e[2] - e[0]).norm();
  f.cross_ratio = cross_ratio((e[1] - e[0]).norm(), (e[2] - e[1]).norm(), (e[3] - e[2]).norm());
  return f;
}

Eigen::Matrix4d features_covariance(const std::array<Eigen::Vector2d, 4>& e, const EdgesCovariance& covariance_px2,
                                    const std::optional<Eigen::Vector2d>& rcm_ideal_px,
                                    const Eigen::Matrix2d& rcm_covariance_px2) {
  const Eigen::Vector2d whole = e[3] - e[0], inner = e[2] - e[0];
  Eigen::Matrix<double, 4, 8> by_points = Eigen::Matrix<double, 4, 8>::Zero();
  const auto point = [&](int feature, Eigen::Index k) { return by_points.block<1, 2>(feature, 2 * k); };
  point(0, 3) = Eigen::RowVector2d(whole.y(), -whole.x()) / whole.squaredNorm();
  point(2, 3) = whole.normalized().transpose();
  point(3, 2) = inner.normalized().transpose();
  for (const int feature : {0, 2, 3}) point(feature, 0) = -(point(feature, 2) + point(feature, 3));
  if (rcm_ideal_px) point(1, 0) = (e[0] - *rcm_ideal_px).normalized().transpose();
  Eigen::Matrix4d covariance = by_points * covariance_px2 * by_points.transpose();
  const Eigen::Vector2d by_rcm = point(1, 0).transpose();
  covariance(1, 1) += by_rcm.dot(rcm_covariance_px2 * by_rcm);
  // Symmetric to the last bit: a log holds one half of it.
  return 0.5 * (covariance + covariance.transpose());
}

std::optional<Eigen::Vector2d> projected_rcm_px(const Camera& camera, const Rigid3& camera_from_rcm) {
  if (!(std::abs(camera_from_rcm.translation.z()) > 1e-6)) return std::nullopt;
  return camera.ideal_from_point(camera_from_rcm.translation);
}

Eigen::Matrix2d projected_rcm_covariance_px2(const Camera& camera, const Rigid3& camera_from_rcm,
                                             const Eigen::Matrix3d& place_covariance_m2) {
  const Eigen::Vector3d& rcm = camera_from_rcm.translation;
  const Eigen::Matrix4d of_matrix = camera.known_covariance().topLeftCorner<4, 4>();
  Eigen::Matrix<double, 2, 4> by_matrix;
  by_matrix << rcm.x() / rcm.z(), 0, 1, 0, 0, rcm.y() / rcm.z(), 0, 1;
  const Eigen::Matrix<double, 2, 3> by_place = camera.ideal_with_jacobian(rcm).d_px_d_point;
  return by_place * place_covariance_m2 * by_place.transpose() + by_matrix * of_matrix * by_matrix.transpose();
}

}  // namespace lapservo::internal
