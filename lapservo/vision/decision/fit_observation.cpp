#include "lapservo/vision/decision/fit_observation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Geometry>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/vision/decision/verification.h"

namespace lapservo::internal {
namespace {

// The centre line's numbers, and how sure the fit is of them. To first order, by differences: gamma moves with the
// pose, psi is its last unknown.
Observation observed_line(const CentreLine& line, const Scene& scene, const FineFit& fit) {
  PoseVector tau = PoseVector::Zero();
  Eigen::Matrix<double, 8, pose_unknowns> edges = Eigen::Matrix<double, 8, pose_unknowns>::Zero();
  const auto after = [&](int unknown, double step) {
    const ShaftPose pose = fit.unknowns.changed_by(step * PoseVector::Unit(unknown)).pose();
    return centre_line(scene.camera, scene.marker, pose.camera_from_unrolled, pose.psi_rad);
  };
  for (int i = 0; i < pose_unknowns; ++i) {
    double step = derivative_step;
    auto moved = after(i, step);
    // Over the seam the inner boundaries jump.
    if (moved && std::abs(moved->tau_rad - line.tau_rad) > pi) moved = after(i, step = -step);
    if (!moved) continue;
    tau[i] = wrap_pi(moved->tau_rad - line.tau_rad) / step;
    for (std::size_t k = 0; k < 4; ++k)
      edges.block<2, 1>(2 * static_cast<Eigen::Index>(k), i) = (moved->ideal_px[k] - line.ideal_px[k]) / step;
  }
  Observation observation;
  observation.tau_rad = line.tau_rad;
  observation.sigma_tau_rad = std::sqrt(tau.dot(fit.covariance * tau));
  observation.edges_ideal_px = line.ideal_px;
  observation.edges_covariance_px2 = edges * fit.covariance * edges.transpose();
  for (std::size_t k = 0; k < 4; ++k) observation.edges_raw_px[k] = scene.camera.raw_from_ideal(line.ideal_px[k]);
  return observation;
}

// A registration that the shaft misses, known only to the distance and the angle by which it does. Nullopt where that
// is more than psi may have.
std::optional<RcmPrior> doubted(const RcmPrior& registration, const ShaftPose& pose) {
  const Eigen::Vector3d to_rcm = registration.camera_from_rcm.translation - pose.camera_from_unrolled.translation;
  const Eigen::Vector3d axis = axis_of(pose);
  const double missed_m = to_rcm.cross(axis).norm(), missed_rad = std::atan2(missed_m, -to_rcm.dot(axis));
  if (!(missed_rad < validation_limits.max_sigma_psi_rad)) return std::nullopt;
  RcmPrior wide = registration;
  wide.covariance.diagonal().head<3>().array() += missed_m * missed_m;
  wide.covariance.diagonal().tail<3>().array() += missed_rad * missed_rad;
  return wide;
}

// `sigma_seam_rad`: of the print's place on the shaft, which psi depends on and the marker's pose does not.
std::optional<Observation::Rcm> rcm_of(const FineFit& fit, const RcmPrior* registration, double sigma_seam_rad) {
  if (!registration) return std::nullopt;
  const auto known =
      fit.unknowns.through_rcm() ? std::optional(*registration) : doubted(*registration, fit.unknowns.pose());
  if (!known) return std::nullopt;
  auto rcm = configuration_estimate(fit.unknowns, fit.covariance, *known, fit.with_registration);
  if (!rcm) return std::nullopt;
  rcm->covariance(3, 3) += sigma_seam_rad * sigma_seam_rad;
  rcm->q.theta_rad = wrap_pi(rcm->q.theta_rad), rcm->q.psi_rad = wrap_pi(rcm->q.psi_rad);
  return rcm;
}

// The same pose in the unrolled frame of another turn about the axis, in which psi is this.
ShaftPose in_azimuths_of(const ShaftPose& pose, double psi_rad) {
  const Rigid3& from = pose.camera_from_unrolled;
  const Eigen::AngleAxisd turn(pose.psi_rad - psi_rad, Eigen::Vector3d::UnitZ());
  return {{(from.rotation * turn).normalized(), from.translation}, psi_rad};
}

}  // namespace

Observation::MarkerPose marker_pose_of(const Marker& marker, const PoseUnknowns& unknowns,
                                       const PoseMatrix& covariance) {
  const ShaftPose& pose = unknowns.pose();
  Observation::MarkerPose result;
  result.camera_from_marker = camera_from_marker(marker, pose.camera_from_unrolled, pose.psi_rad);
  Eigen::Quaterniond& rotation = result.camera_from_marker.rotation;
  if (rotation.w() < 0) rotation.coeffs() *= -1;  // one of the two that mean the same
  const Eigen::Vector3d& origin = result.camera_from_marker.translation;
  const Eigen::Matrix3d axes = result.camera_from_marker.rotation.toRotationMatrix();
  // The origin's rows, then those of the rotation that turns the three axes as they turn.
  PoseMatrix jacobian = PoseMatrix::Zero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Vector3d direction = Eigen::Vector3d::Unit(i);
    const PoseVector of_origin = unknowns.row(origin, direction).head<pose_unknowns>();
    jacobian.row(i) = of_origin;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const PoseVector of_end = unknowns.row(origin + axes.col(axis), direction).head<pose_unknowns>();
      jacobian.bottomRows<3>() += axes.col(axis).cross(direction) * (of_end - of_origin).transpose() / 2;
    }
  }
  jacobian.col(psi_unknown).tail<3>() += axes.col(2);
  result.covariance = jacobian * covariance * jacobian.transpose();
  const Eigen::Matrix3d turns = result.covariance.bottomRightCorner<3, 3>();
  const double roll_variance = axes.col(2).dot(turns * axes.col(2));
  result.sigma_xy_m = std::sqrt((result.covariance(0, 0) + result.covariance(1, 1)) / 2);
  result.sigma_z_m = std::sqrt(result.covariance(2, 2));
  result.sigma_axis_rad = std::sqrt(std::max(0.0, turns.trace() - roll_variance));
  result.sigma_roll_rad = std::sqrt(roll_variance);
  return result;
}

Observation observation_of(const Scene& scene, const FineFit& fit) {
  const ShaftPose& pose = fit.unknowns.pose();
  const auto line = centre_line(scene.camera, scene.marker, pose.camera_from_unrolled, pose.psi_rad);
  if (!line) return refused_observation(Status::poor_fit);
  Observation observation = observed_line(*line, scene, fit);
  observation.status = Status::ok;
  const RcmPrior* registration = scene.registration;
  observation.features = features_of(
      line->ideal_px, registration ? projected_rcm_px(scene.camera, registration->camera_from_rcm) : std::nullopt);
  observation.p_false = fit.p_false;
  observation.marker = marker_pose_of(scene.marker, fit.unknowns, fit.covariance);
  observation.rcm = rcm_of(fit, registration, scene.marker.sigmas.seam_rad.value_or(0));
  const ShaftPose told = observation.rcm ? in_azimuths_of(pose, observation.rcm->q.psi_rad) : pose;
  observation.camera_from_unrolled = told.camera_from_unrolled;
  observation.psi_rad = told.psi_rad;
  return observation;
}

Observation refused_observation(Status why, const std::optional<ShaftPose>& pose) {
  Observation observation;
  observation.status = why;
  if (pose) observation.refused = {Observation::Refused::What::pose, pose->camera_from_unrolled, pose->psi_rad};
  return observation;
}

}  // namespace lapservo::internal
