#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/rotation.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

inline constexpr double derivative_step = 1e-6;
using RegistrationMatrix = Eigen::Matrix<double, 6, 6>;

/// That a shaft's axis passes the RCM, as a measurement of the pose: its two distances from the RCM, 0 within what the
/// registration is known to. In units of their sigma, independent of one another.
struct RcmMeasurement {
  Eigen::Matrix<double, 2, fit_unknowns> rows = Eigen::Matrix<double, 2, fit_unknowns>::Zero();
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();
  /// d(residual)/d(RCM in the camera frame) [1/m].
  Eigen::Matrix<double, 2, 3> by_rcm_m = Eigen::Matrix<double, 2, 3>::Zero();
  bool is_proximal = true;  ///< the RCM lies on the marker's proximal side, as that of every shaft does
};

/// The rig's knowledge of an instrument's RCM frame.
struct RcmPrior {
  Rigid3 camera_from_rcm;
  /// For the translation [m], then a rotation vector about the camera's axes [rad]; zero where it counts as exact.
  RegistrationMatrix covariance = RegistrationMatrix::Zero();

  /// The distances count as known to `least_sigma_m` at best: a rough pose is held at the RCM as well as it is known.
  RcmMeasurement of(const ShaftPose& pose, double least_sigma_m) const;
  /// Whether the RCM is known to within this radius, so that the lines through it lie on their shafts.
  bool is_within(double radius_m) const;
};

/// Nullopt where the rig knows nothing of it.
std::optional<RcmPrior> registration_of(const Instrument& instrument);

/// theta, phi, rho, psi; angles the shorter way.
Eigen::Vector4d configuration_change(const JointVector& from, const JointVector& to);

/// How q depends on the registration's translation [m] and rotation vector about the camera's axes [rad]. `q_of`: an
/// optional JointVector by camera_from_rcm; a column is zero where there is none.
template <typename Configuration>
Eigen::Matrix<double, 4, 6> by_registration(const Rigid3& camera_from_rcm, const JointVector& q,
                                            const Configuration& q_of) {
  Eigen::Matrix<double, 4, 6> slopes = Eigen::Matrix<double, 4, 6>::Zero();
  for (int i = 0; i < 6; ++i) {
    Rigid3 moved = camera_from_rcm;
    const Eigen::Vector3d step = derivative_step * Eigen::Vector3d::Unit(i % 3);
    if (i < 3)
      moved.translation += step;
    else
      moved.rotation = rotation_by(step) * moved.rotation;
    if (const std::optional<JointVector> changed = q_of(moved))
      slopes.col(i) = configuration_change(q, *changed) / derivative_step;
  }
  return slopes;
}

/// q by a pose and a registration, and how sure it is by both; to first order. `pose_by_registration`: covariance of
/// the pose's unknowns with the registration's numbers. Nullopt where the pose has no q.
std::optional<Observation::Rcm> configuration_estimate(
    const PoseUnknowns& unknowns, const PoseMatrix& covariance, const RcmPrior& registration,
    const Eigen::Matrix<double, pose_unknowns, 6>& pose_by_registration);

}  // namespace lapservo::internal
