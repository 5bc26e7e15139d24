#include "lapservo/vision/shaft/rcm_prior.h"

#include <cmath>

#include <Eigen/Cholesky>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/rig/registration_covariance.h"

namespace lapservo::internal {
namespace {

using Registration = Eigen::Matrix<double, 6, 1>;

Rigid3 moved(const Rigid3& camera_from_rcm, const Registration& by) {
  return {rotation_by(by.tail<3>()) * camera_from_rcm.rotation, camera_from_rcm.translation + by.head<3>()};
}

Eigen::Vector4d difference(const JointVector& from, const JointVector& to) {
  Eigen::Vector4d change = to.vector() - from.vector();
  for (const Eigen::Index angle : {0, 1, 3}) change[angle] = wrap_pi(change[angle]);
  return change;
}

}  // namespace

RcmMeasurement RcmPrior::of(const ShaftPose& pose, double least_sigma_m) const {
  const Eigen::Matrix3d axes = pose.camera_from_unrolled.rotation.toRotationMatrix();
  const Eigen::Matrix<double, 2, 3> across = axes.leftCols<2>().transpose();
  const Eigen::Vector3d rcm = axes.transpose() * (camera_from_rcm.translation - pose.camera_from_unrolled.translation);
  const Eigen::Matrix2d variances = across * covariance.topLeftCorner<3, 3>() * across.transpose() +
                                    least_sigma_m * least_sigma_m * Eigen::Matrix2d::Identity();
  const Eigen::LLT<Eigen::Matrix2d> root(variances);
  RcmMeasurement measurement;
  // Where the RCM lies in the unrolled frame, as that turns about its x and y and moves along them.
  Eigen::Matrix<double, 2, fit_unknowns> rows = Eigen::Matrix<double, 2, fit_unknowns>::Zero();
  rows(0, 1) = -rcm.z(), rows(0, 2) = -1;
  rows(1, 0) = rcm.z(), rows(1, 3) = -1;
  measurement.rows = root.matrixL().solve(rows);
  measurement.residual = root.matrixL().solve(Eigen::Vector2d(-rcm.head<2>()));
  measurement.by_rcm_m = root.matrixL().solve(Eigen::Matrix<double, 2, 3>(-across));
  measurement.is_proximal = rcm.z() < 0;
  return measurement;
}

std::optional<RcmPrior> registration_of(const Instrument& instrument) {
  if (!instrument.camera_from_rcm) return std::nullopt;
  return RcmPrior{*instrument.camera_from_rcm, registration_covariance(instrument)};
}

bool RcmPrior::is_within(double radius_m) const {
  return std::sqrt(covariance.topLeftCorner<3, 3>().trace()) < radius_m;
}

std::optional<ConfigurationEstimate> configuration_estimate(
    const PoseUnknowns& unknowns, const PoseMatrix& covariance, const RcmPrior& registration,
    const Eigen::Matrix<double, pose_unknowns, 6>& pose_by_registration) {
  constexpr double step = 1e-6;
  const auto q = configuration_of(unknowns.pose(), registration.camera_from_rcm);
  if (!q) return std::nullopt;
  const auto slope = [&](const std::optional<JointVector>& changed) -> Eigen::Vector4d {
    return changed ? Eigen::Vector4d(difference(*q, *changed) / step) : Eigen::Vector4d::Zero();
  };
  Eigen::Matrix<double, 4, pose_unknowns> by_pose;
  Eigen::Matrix<double, 4, 6> by_registration;
  for (int i = 0; i < pose_unknowns; ++i)
    by_pose.col(i) =
        slope(configuration_of(unknowns.changed_by(step * PoseVector::Unit(i)).pose(), registration.camera_from_rcm));
  for (int i = 0; i < 6; ++i)
    by_registration.col(i) =
        slope(configuration_of(unknowns.pose(), moved(registration.camera_from_rcm, step * Registration::Unit(i))));
  const Eigen::Matrix4d both = by_pose * pose_by_registration * by_registration.transpose();
  return ConfigurationEstimate{*q, by_pose * covariance * by_pose.transpose() + both + both.transpose() +
                                       by_registration * registration.covariance * by_registration.transpose()};
}

}  // namespace lapservo::internal
