#include "lapservo/rig/registration_covariance.h"

#include <Eigen/QR>

namespace lapservo::internal {
namespace {

using Slopes = Eigen::Matrix<double, 4, 3>;

// d(x y z w)/d(rotation about the camera's axes).
Slopes quaternion_slopes(const Eigen::Quaterniond& q) {
  Slopes slopes;
  for (Eigen::Index i = 0; i < 3; ++i) {
    Eigen::Quaterniond turn(0, 0, 0, 0);
    turn.vec()[i] = 0.5;
    slopes.col(i) = (turn * q).coeffs();
  }
  return slopes;
}

// The variances about the axes that give the quaternion's; where these leave some open, the most alike.
Eigen::Vector3d rotation_variances(const Eigen::Quaterniond& q, const Eigen::Vector4d& sigmas) {
  const Slopes squares = quaternion_slopes(q).cwiseAbs2();
  const Eigen::Vector4d variances = sigmas.cwiseAbs2();
  return Eigen::CompleteOrthogonalDecomposition<Slopes>(squares).solve(variances).cwiseMax(0);
}

}  // namespace

Eigen::Matrix<double, 6, 6> registration_covariance(const Instrument& instrument) {
  if (instrument.registration_covariance) return *instrument.registration_covariance;
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  if (const auto& sigma_m = instrument.sigma_translation_m)
    covariance.diagonal().head<3>() = Eigen::Map<const Eigen::Vector3d>(sigma_m->data()).cwiseAbs2();
  if (const auto& sigma = instrument.sigma_quaternion_xyzw)
    covariance.diagonal().tail<3>() =
        rotation_variances(instrument.camera_from_rcm->rotation, Eigen::Map<const Eigen::Vector4d>(sigma->data()));
  return covariance;
}

std::string exact_registration_text(const Instrument& instrument) {
  if (!instrument.camera_from_rcm || !registration_covariance(instrument).isZero()) return "";
  return instrument.name +
         ": camera_from_rcm has no standard deviations and counts as exact: q's are the frame's alone";
}

Eigen::Matrix<double, 6, 6> in_camera_axes(const Rigid3& camera_from_rcm,
                                           const Eigen::Matrix<double, 6, 6>& of_rotation_and_translation) {
  Eigen::Matrix<double, 6, 6> from_own = Eigen::Matrix<double, 6, 6>::Zero();
  from_own.topRightCorner<3, 3>().setIdentity();
  from_own.bottomLeftCorner<3, 3>() = camera_from_rcm.rotation.toRotationMatrix();
  return from_own * of_rotation_and_translation * from_own.transpose();
}

}  // namespace lapservo::internal
