#include "lapservo/kinematics/feature_map.h"

#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>

#include "lapservo/geometry/cylinder.h"
#include "lapservo/kinematics/centre_line.h"

namespace lapservo::internal {
namespace {

constexpr double min_px = 1e-6;  // lengths below it give no direction

using PerJoint = Eigen::Matrix<double, 2, 4>;  // of an image point, by q

// How the facing azimuth turns with the shaft about an axis. The RCM is the fixed point of the rotation, so the camera
// centre, seen from it in unrolled axes, is w = -U^T t, and turns against the axis: dw = -axis x w.
double facing_azimuth_rate(const Eigen::Vector3d& w, const Eigen::Vector3d& axis) {
  const Eigen::Vector3d dw = -axis.cross(w);
  return (w.x() * dw.y() - w.y() * dw.x()) / w.head<2>().squaredNorm();
}

// d(e_k)/dq for k = 0..3.
std::array<PerJoint, 4> edge_rates(const ImageModel& model, const JointVector& q, const CentreLine& line) {
  const Eigen::Quaterniond camera_from_unrolled = model.camera_from_rcm.rotation * rcm_from_unrolled(q).rotation;
  const Eigen::Vector3d theta_axis(-std::sin(q.phi_rad), 0, std::cos(q.phi_rad));  // RCM's z, in unrolled axes
  const Eigen::Vector3d along = Eigen::Vector3d::UnitZ();
  const double gamma = line.facing_azimuth_rad;
  const Eigen::Vector3d around = model.marker.radius_m() * Eigen::Vector3d(-std::sin(gamma), std::cos(gamma), 0);
  const Eigen::Vector3d w = -(camera_from_unrolled.conjugate() * model.camera_from_rcm.translation);
  const double d_theta = facing_azimuth_rate(w, theta_axis), d_phi = facing_azimuth_rate(w, Eigen::Vector3d::UnitY());
  const auto along_m = boundaries_m(model.marker, line.tau_rad);
  const auto slopes_m = boundary_slopes_m(model.marker);

  std::array<PerJoint, 4> rates;
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d arm = surface_point(model.marker.radius_m(), gamma, q.rho_m + along_m[k]);
    const Eigen::Vector3d by_gamma = around + slopes_m[k] * along;  // tau turns with gamma, and moves the boundary
    Eigen::Matrix<double, 3, 4> in_unrolled;
    in_unrolled.col(0) = theta_axis.cross(arm) + d_theta * by_gamma;
    in_unrolled.col(1) = Eigen::Vector3d::UnitY().cross(arm) + d_phi * by_gamma;
    in_unrolled.col(2) = along;
    in_unrolled.col(3) = -slopes_m[k] * along;
    rates[k] = model.camera.ideal_with_jacobian(line.points_in_camera_m[k]).d_px_d_point *
               (camera_from_unrolled.toRotationMatrix() * in_unrolled);
  }
  return rates;
}

Eigen::RowVector4d length_rate(const Eigen::Vector2d& from_to, const PerJoint& rate) {
  return from_to.normalized().transpose() * rate;
}

}  // namespace

std::optional<FeaturePoint> feature_map(const ImageModel& model, const JointVector& q) {
  if (!q.vector().allFinite()) return std::nullopt;
  const auto rcm_px = projected_rcm_px(model.camera, model.camera_from_rcm);
  const auto line = centre_line(model.camera, model.marker, model.camera_from_rcm * rcm_from_unrolled(q), q.psi_rad);
  if (!rcm_px || !line) return std::nullopt;
  const auto& e = line->ideal_px;
  const Eigen::Vector2d from_rcm = e[0] - *rcm_px, whole = e[3] - e[0], inner = e[2] - e[0];
  if (!(whole.norm() > min_px && inner.norm() > min_px && from_rcm.norm() > min_px)) return std::nullopt;

  const auto rates = edge_rates(model, q, *line);
  const PerJoint whole_rate = rates[3] - rates[0];
  FeaturePoint point;
  point.f << std::atan2(whole.x(), whole.y()), from_rcm.norm(), whole.norm(), inner.norm();
  point.jacobian.row(0) = Eigen::RowVector2d(whole.y(), -whole.x()) * whole_rate / whole.squaredNorm();
  point.jacobian.row(1) = length_rate(from_rcm, rates[0]);
  point.jacobian.row(2) = length_rate(whole, whole_rate);
  point.jacobian.row(3) = length_rate(inner, rates[2] - rates[0]);
  point.ends_jacobian << rates[0], rates[3];
  point.tau_rad = line->tau_rad;
  point.ideal_px = e;
  return point;
}

}  // namespace lapservo::internal
