#include "lapservo/vision/result/fit_observation.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/vision/result/marker_pose.h"

namespace lapservo::internal {
namespace {

// How sure the fit is of what the centre line shows.
struct LineSigma {
  double tau_rad = 0;
  EdgesCovariance edges_px2;
};

// To first order, by differences: gamma moves with the pose, psi is its last unknown.
LineSigma sigma_of(const CentreLine& line, const Scene& scene, const FineFit& fit) {
  const int n = fit.unknowns.size();
  UnknownVector tau = UnknownVector::Zero(n);
  Eigen::Matrix<double, 8, Eigen::Dynamic, 0, 8, max_unknowns> edges;
  edges.setZero(8, n);
  const auto after = [&](int unknown, double step) {
    UnknownVector change = UnknownVector::Zero(n);
    change[unknown] = step;
    const ShaftPose pose = fit.unknowns.changed_by(change).pose();
    return centre_line(scene.camera, scene.marker, pose.camera_from_unrolled, pose.psi_rad);
  };
  for (int i = 0; i < n; ++i) {
    double step = 1e-6;
    auto moved = after(i, step);
    // Over the seam the inner boundaries jump.
    if (moved && std::abs(moved->tau_rad - line.tau_rad) > pi) moved = after(i, step = -step);
    if (!moved) continue;
    tau[i] = wrap_pi(moved->tau_rad - line.tau_rad) / step;
    for (std::size_t k = 0; k < 4; ++k)
      edges.block<2, 1>(2 * static_cast<Eigen::Index>(k), i) = (moved->ideal_px[k] - line.ideal_px[k]) / step;
  }
  LineSigma sigma;
  sigma.tau_rad = std::sqrt(tau.dot(fit.covariance * tau));
  const Eigen::Matrix<double, 8, Eigen::Dynamic, 0, 8, max_unknowns> weighted = edges.lazyProduct(fit.covariance);
  sigma.edges_px2 = weighted.lazyProduct(edges.transpose());
  return sigma;
}

// q of a freely fitted shaft that misses the RCM: the shaft from the RCM to the marker's proximal end. The angle
// between it and the fitted axis is how wrong each angle may be; where that is too much, q is unknown.
std::optional<Observation::Rcm> configuration_despite_mismatch(const FineFit& fit, const Rigid3& camera_from_rcm) {
  constexpr double max_mismatch_rad = 0.03;
  const Rigid3& fitted = fit.unknowns.pose().camera_from_unrolled;
  const auto q = configuration_of(fit.unknowns.pose(), camera_from_rcm);
  if (!q) return std::nullopt;
  const Rigid3 through_rcm = camera_from_rcm * rcm_from_unrolled(*q);
  const Eigen::Vector3d z = Eigen::Vector3d::UnitZ();
  const double mismatch_rad = std::atan2((fitted.rotation * z).cross(through_rcm.rotation * z).norm(),
                                         (fitted.rotation * z).dot(through_rcm.rotation * z));
  if (!(mismatch_rad < max_mismatch_rad)) return std::nullopt;
  const double angle_variance =
      mismatch_rad * mismatch_rad + fit.covariance(fit.unknowns.size() - 1, fit.unknowns.size() - 1);
  const double rho_variance = mismatch_rad * mismatch_rad * q->rho_m * q->rho_m + fit.covariance(4, 4);
  const Eigen::Vector4d variances(angle_variance, angle_variance, rho_variance, angle_variance);
  return Observation::Rcm{*q, variances.asDiagonal()};
}

}  // namespace

Observation observation_of(const Scene& scene, const FineFit& fit, const std::optional<Rigid3>& camera_from_rcm) {
  Observation observation;
  const ShaftPose& pose = fit.unknowns.pose();
  const auto line = centre_line(scene.camera, scene.marker, pose.camera_from_unrolled, pose.psi_rad);
  if (!line) {
    observation.status = Status::poor_fit;
    return observation;
  }
  observation.status = Status::ok;
  const LineSigma sigma = sigma_of(*line, scene, fit);
  observation.tau_rad = line->tau_rad;
  observation.sigma_tau_rad = sigma.tau_rad;
  observation.edges_ideal_px = line->ideal_px;
  observation.edges_covariance_px2 = sigma.edges_px2;
  for (std::size_t k = 0; k < 4; ++k) observation.edges_raw_px[k] = scene.camera.raw_from_ideal(line->ideal_px[k]);
  observation.features =
      features_of(line->ideal_px, camera_from_rcm ? projected_rcm_px(scene.camera, *camera_from_rcm) : std::nullopt);
  observation.camera_from_unrolled = pose.camera_from_unrolled;
  observation.psi_rad = pose.psi_rad;
  observation.p_false = std::max(fit.p_false, p_false_of(0, fit.psi_variance_rad2()));
  observation.marker = marker_pose_of(scene.marker, fit.unknowns, fit.covariance);
  if (fit.unknowns.q()) {
    observation.rcm = Observation::Rcm{*fit.unknowns.q(), fit.covariance};
  } else if (camera_from_rcm) {
    observation.rcm = configuration_despite_mismatch(fit, *camera_from_rcm);
  }
  if (observation.rcm) {
    observation.rcm->q.theta_rad = wrap_pi(observation.rcm->q.theta_rad);
    observation.rcm->q.psi_rad = wrap_pi(observation.rcm->q.psi_rad);
  }
  return observation;
}

Observation refused_observation(Status why, const ShaftPose& pose) {
  Observation observation;
  observation.status = why;
  observation.refused.what = Observation::Refused::What::pose;
  observation.refused.camera_from_unrolled = pose.camera_from_unrolled;
  observation.refused.psi_rad = pose.psi_rad;
  return observation;
}

}  // namespace lapservo::internal
