#include "lapservo/vision/shaft/rcm_prior.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "lapservo/core/angles.h"
#include "lapservo/rig/registration_covariance.h"

namespace lapservo::internal {

Eigen::Vector4d configuration_change(const JointVector& from, const JointVector& to) {
  Eigen::Vector4d change = to.vector() - from.vector();
  for (const Eigen::Index angle : {0, 1, 3}) change[angle] = wrap_pi(change[angle]);
  return change;
}

RcmMeasurement RcmPrior::of(const ShaftPose& pose, double least_sigma_m) const {
  const Eigen::Matrix3d axes = pose.camera_from_unrolled.rotation.toRotationMatrix();
  const Eigen::Matrix<double, 2, 3> across = axes.leftCols<2>().transpose();
  const Eigen::Vector3d rcm = axes.transpose() * (camera_from_rcm.translation - pose.camera_from_unrolled.translation);
  const Eigen::Matrix2d variances = across * covariance.topLeftCorner<3, 3>() * across.transpose() +
                                    least_sigma_m * least_sigma_m * Eigen::Matrix2d::Identity();
  const Eigen::LLT<Eigen::Matrix2d> root(variances);
  // Where the RCM lies in the unrolled frame, as that turns about its x and y and moves along them.
  Eigen::Matrix<double, 2, fit_unknowns> rows = Eigen::Matrix<double, 2, fit_unknowns>::Zero();
  rows(0, 1) = -rcm.z(), rows(0, 2) = -1;
  rows(1, 0) = rcm.z(), rows(1, 3) = -1;
  return {root.matrixL().solve(rows), root.matrixL().solve(Eigen::Vector2d(-rcm.head<2>())),
          root.matrixL().solve(Eigen::Matrix<double, 2, 3>(-across)), rcm.z() < 0};
}

std::optional<RcmPrior> registration_of(const Instrument& instrument) {
  if (!instrument.camera_from_rcm) return std::nullopt;
  return RcmPrior{*instrument.camera_from_rcm, registration_covariance(instrument)};
}

bool RcmPrior::is_within(double radius_m) const {
  return std::sqrt(covariance.topLeftCorner<3, 3>().trace()) < radius_m;
}

std::optional<Observation::Rcm> configuration_estimate(
    const PoseUnknowns& unknowns, const PoseMatrix& covariance, const RcmPrior& registration,
    const Eigen::Matrix<double, pose_unknowns, 6>& pose_by_registration) {
  const auto q = configuration_of(unknowns.pose(), registration.camera_from_rcm);
  if (!q) return std::nullopt;
  Eigen::Matrix<double, 4, pose_unknowns> by_pose = Eigen::Matrix<double, 4, pose_unknowns>::Zero();
  for (int i = 0; i < pose_unknowns; ++i) {
    const ShaftPose changed = unknowns.changed_by(derivative_step * PoseVector::Unit(i)).pose();
    if (const auto moved = configuration_of(changed, registration.camera_from_rcm))
      by_pose.col(i) = configuration_change(*q, *moved) / derivative_step;
  }
  const Eigen::Matrix<double, 4, 6> slopes = by_registration(
      registration.camera_from_rcm, *q,
      [&](const Rigid3& camera_from_rcm) { return configuration_of(unknowns.pose(), camera_from_rcm); });
  const Eigen::Matrix4d both = by_pose * pose_by_registration * slopes.transpose();
  return Observation::Rcm{*q, by_pose * covariance * by_pose.transpose() + both + both.transpose() +
                                  slopes * registration.covariance * slopes.transpose()};
}

}  // namespace lapservo::internal
