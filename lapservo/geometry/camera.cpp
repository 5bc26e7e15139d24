#include "lapservo/geometry/camera.h"

#include <Eigen/LU>

namespace lapservo {
namespace {

struct Distorted {
  Eigen::Vector2d point;
  Eigen::Matrix2d jacobian;
};

// plumb_bob on normalised image coordinates, with its derivative.
Distorted distort(const std::array<double, 5>& k, const Eigen::Vector2d& x) {
  const double r2 = x.squaredNorm();
  const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double d_radial = k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]);  // by r2
  const Eigen::Vector2d tangential(2 * k[2] * x.x() * x.y() + k[3] * (r2 + 2 * x.x() * x.x()),
                                   k[2] * (r2 + 2 * x.y() * x.y()) + 2 * k[3] * x.x() * x.y());
  Distorted out;
  out.point = radial * x + tangential;
  out.jacobian = radial * Eigen::Matrix2d::Identity() + 2 * d_radial * x * x.transpose();
  const double cross = 2 * (k[2] * x.x() + k[3] * x.y());
  out.jacobian +=
      Eigen::Matrix2d{{2 * k[2] * x.y() + 6 * k[3] * x.x(), cross}, {cross, 6 * k[2] * x.y() + 2 * k[3] * x.x()}};
  return out;
}

}  // namespace

Eigen::Matrix<double, 9, 9> Camera::known_covariance() const {
  if (covariance) return *covariance;
  Eigen::Vector<double, 9> by_sigmas;
  by_sigmas << sigmas.fx_px, sigmas.fy_px, sigmas.cx_px, sigmas.cy_px,
      Eigen::Map<const Eigen::Vector<double, 5>>(sigmas.distortion.data());
  Eigen::Matrix<double, 9, 9> known = by_sigmas.cwiseAbs2().asDiagonal();
  known(0, 1) = known(1, 0) = sigmas.fx_px * sigmas.fy_px / 3;
  return known;
}

bool Camera::contains(const Eigen::Vector2d& raw_px, double margin_px) const {
  return raw_px.x() >= margin_px && raw_px.y() >= margin_px && raw_px.x() <= width_px - 1 - margin_px &&
         raw_px.y() <= height_px - 1 - margin_px;
}

Eigen::Vector2d Camera::distorted_from_ideal(const Eigen::Vector2d& ideal_px) const {
  const Eigen::Vector2d x = distort(distortion, ray_from_ideal(ideal_px).head<2>()).point;
  return {cx_px + fx_px * x.x(), cy_px + fy_px * x.y()};
}

std::optional<Eigen::Vector2d> Camera::ideal_from_raw(const Eigen::Vector2d& raw_px) const {
  if (!distorted()) return raw_px;
  constexpr int max_steps = 30;
  constexpr double tolerance = 1e-12;
  const Eigen::Vector2d target = ray_from_ideal(raw_px).head<2>();
  Eigen::Vector2d x = target;
  for (int step = 0; step < max_steps; ++step) {
    const Distorted at = distort(distortion, x);
    // Past the turning point of the radial polynomial the map folds: its inverse there is not the one that we want.
    if (!(at.jacobian.determinant() > 0) || !(at.jacobian.trace() > 0)) return std::nullopt;
    const Eigen::Vector2d change = at.jacobian.inverse() * (target - at.point);
    x += change;
    if (!x.allFinite()) return std::nullopt;
    if (change.squaredNorm() < tolerance * tolerance)
      return Eigen::Vector2d(cx_px + fx_px * x.x(), cy_px + fy_px * x.y());
  }
  return std::nullopt;
}

ProjectionWithJacobian Camera::ideal_with_jacobian(const Eigen::Vector3d& p) const {
  const double inverse_z = 1 / p.z();
  const double x = p.x() * inverse_z, y = p.y() * inverse_z;
  ProjectionWithJacobian out;
  out.point_px = {cx_px + fx_px * x, cy_px + fy_px * y};
  out.d_px_d_point << fx_px * inverse_z, 0, -fx_px * x * inverse_z, 0, fy_px * inverse_z, -fy_px * y * inverse_z;
  return out;
}

ProjectionWithJacobian Camera::raw_with_jacobian(const Eigen::Vector3d& p) const {
  if (!distorted()) return ideal_with_jacobian(p);
  const double inverse_z = 1 / p.z();
  const Eigen::Vector2d x = p.head<2>() * inverse_z;
  const Distorted at = distort(distortion, x);
  Eigen::Matrix<double, 2, 3> d_x;
  d_x << inverse_z, 0, -x.x() * inverse_z, 0, inverse_z, -x.y() * inverse_z;
  const Eigen::Vector2d focal(fx_px, fy_px);
  ProjectionWithJacobian out;
  out.point_px = Eigen::Vector2d(cx_px, cy_px) + focal.cwiseProduct(at.point);
  out.d_px_d_point = focal.asDiagonal() * (at.jacobian * d_x);
  return out;
}

Eigen::Vector3d Camera::ray_from_ideal(const Eigen::Vector2d& ideal_px) const {
  return {(ideal_px.x() - cx_px) / fx_px, (ideal_px.y() - cy_px) / fy_px, 1.0};
}

}  // namespace lapservo
