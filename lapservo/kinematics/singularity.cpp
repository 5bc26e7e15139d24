#include "lapservo/kinematics/singularity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <Eigen/SVD>

namespace lapservo {
namespace {

constexpr double kink_px = 1;

Eigen::Vector4d paths_per_joint_m(const ImageModel& model, const RcmCoordinates& q) {
  const double arm_m = std::max(std::abs(q.rho_m), model.marker.radius_m());
  return {arm_m, arm_m, 1, model.marker.radius_m()};
}

Eigen::Matrix4d natural_jacobian(const ImageModel& model, const FeaturePoint& point, const Eigen::Vector4d& path_m) {
  const double px_per_m = std::sqrt(model.camera.fx_px * model.camera.fy_px) / point.points_in_camera_m[0].z();
  const Eigen::Vector4d rows = Eigen::Vector4d(point.f[2], 1, 1, 1) / px_per_m;
  return rows.asDiagonal() * point.jacobian * path_m.cwiseInverse().asDiagonal();
}

// The cause is whichever known one is the closest, each measured by a sine that vanishes at it.
Singularity cause(const ImageModel& model, const RcmCoordinates& q, const FeaturePoint& point) {
  const Eigen::Vector3d middle = (point.points_in_camera_m[0] + point.points_in_camera_m[3]) / 2;
  const Eigen::Vector3d along = (point.points_in_camera_m[3] - point.points_in_camera_m[0]).normalized();
  const double off_sight = along.cross(middle.normalized()).norm();
  const double rotation_gain = std::abs(boundary_slopes_m(model.marker)[2]) / model.marker.radius_m();
  const std::array<std::pair<double, Singularity>, 3> causes{
      {{std::abs(std::sin(q.phi_rad)), Singularity::rcm_frame_pole},
       {off_sight, Singularity::foreshortened},
       {rotation_gain, Singularity::rotation_not_in_d}}};
  constexpr double close = 0.1;
  const auto nearest = std::min_element(causes.begin(), causes.end());
  return nearest->first < close ? nearest->second : Singularity::tilt_like_insertion;
}

}  // namespace

std::string_view singularity_word(Singularity kind) {
  switch (kind) {
    case Singularity::none:
      return "none";
    case Singularity::undefined:
      return "undefined";
    case Singularity::rcm_frame_pole:
      return "rcm_frame_pole";
    case Singularity::foreshortened:
      return "foreshortened";
    case Singularity::at_projected_rcm:
      return "at_projected_rcm";
    case Singularity::rotation_not_in_d:
      return "rotation_not_in_d";
    case Singularity::tilt_like_insertion:
      return "tilt_like_insertion";
  }
  return "none";
}

SingularityReport singularity(const ImageModel& model, const RcmCoordinates& q) {
  const FeatureMapResult result = feature_map(model, q);
  if (!result.point) return {Singularity::undefined, result.reason};
  const Eigen::Vector4d path_m = paths_per_joint_m(model, q);
  const Eigen::JacobiSVD<Eigen::Matrix4d> svd(natural_jacobian(model, *result.point, path_m), Eigen::ComputeFullV);
  SingularityReport report;
  report.smallest_singular_value = svd.singularValues()[3];
  report.least_seen = svd.matrixV().col(3).cwiseQuotient(path_m);
  if (report.smallest_singular_value < singular_below)
    report.kind = cause(model, q, *result.point);
  else if (result.point->f[1] < kink_px)
    report.kind = Singularity::at_projected_rcm;
  return report;
}

}  // namespace lapservo
