#include "lapservo/rig/registration_covariance.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::internal::registration_covariance_test {

using Covariance = Eigen::Matrix<double, 6, 6>;

Instrument turned_by(const Eigen::Vector3d& vector_rad) {
  return {"", {}, Rigid3{rotation_by(vector_rad), {0.01, 0.02, 0.1}}};
}

// The sigmas of a quaternion whose rotation is as uncertain about each axis are those of that rotation.
TEST(RegistrationCovariance, FollowsFromTheSigmasOfTheTransform) {
  constexpr double sigma_rad = 5e-3, step = 1e-6;
  Random random(1);
  for (int draw = 0; draw < 20; ++draw) {
    Instrument instrument = turned_by(Eigen::Vector3d(random.normal(), random.normal(), random.normal()));
    const Eigen::Quaterniond& q = instrument.camera_from_rcm->rotation;
    Eigen::Array4d variances = Eigen::Array4d::Zero();
    for (int axis = 0; axis < 3; ++axis)
      variances += ((rotation_by(step * Eigen::Vector3d::Unit(axis)) * q).coeffs() - q.coeffs()).array().square() /
                   (step * step) * sigma_rad * sigma_rad;
    std::array<double, 4> sigmas;
    Eigen::Map<Eigen::Array4d>(sigmas.data()) = variances.sqrt();
    instrument.sigma_quaternion_xyzw = sigmas;
    instrument.sigma_translation_m = {1e-3, 2e-3, 3e-3};
    const Covariance covariance = registration_covariance(instrument);
    EXPECT_NEAR(covariance(1, 1), 4e-6, 1e-12);
    for (int axis = 3; axis < 6; ++axis) EXPECT_NEAR(std::sqrt(covariance(axis, axis)), sigma_rad, 1e-6) << axis;
  }
}

TEST(RegistrationCovariance, IsTheRigsWhereItHasOneAndZeroWithoutSigmas) {
  EXPECT_EQ(registration_covariance(turned_by({0.1, 0.2, 0.3})), Covariance::Zero());
  Instrument instrument = turned_by({0, 0, 0});
  instrument.sigma_translation_m = {1e-3, 2e-3, 3e-3};
  instrument.registration_covariance = 2e-6 * Covariance::Identity();
  EXPECT_EQ(registration_covariance(instrument), *instrument.registration_covariance);
}

}  // namespace lapservo::internal::registration_covariance_test
