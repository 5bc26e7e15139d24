#include "lapservo/vision/shaft/rcm_prior.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/rotation.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::rcm_prior_test {

using Six = Eigen::Matrix<double, 6, 1>;

Six normal_vector(Random& random) {
  Six vector;
  for (double& number : vector) number = random.normal();
  return vector;
}

RegistrationMatrix random_covariance(double sigma, Random& random) {
  RegistrationMatrix root;
  for (double& number : root.reshaped()) number = sigma * random.normal();
  return root * root.transpose();
}

struct Scene {
  RcmPrior registration;
  JointVector q;
  PoseUnknowns unknowns;

  explicit Scene(Random& random) {
    const Six place = normal_vector(random);
    registration.camera_from_rcm = {rotation_by(place.head<3>()), 0.05 * place.tail<3>()};
    registration.covariance = random_covariance(1e-4, random);
    q = {random.uniform(-1, 1), random.uniform(0.8, 2.2), random.uniform(0.06, 0.15), random.uniform(-3, 3)};
    unknowns = {pose_through_rcm(registration.camera_from_rcm, q), true};
  }
};

TEST(RcmPrior, AShaftThroughTheRcmDoesNotMissItAndRowsAreTheDerivativesOfWhatOthersDo) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    testing::SeededRandom random(seed);
    const Scene scene(random);
    constexpr double least_m = 1e-4, step = 1e-7;
    const RcmMeasurement at = scene.registration.of(scene.unknowns.pose(), least_m);
    EXPECT_LT(at.residual.norm(), 1e-9);
    for (int i = 0; i < pose_unknowns; ++i) {
      const PoseUnknowns moved = scene.unknowns.changed_by(step * PoseVector::Unit(i));
      const Eigen::Vector2d residual = scene.registration.of(moved.pose(), least_m).residual;
      EXPECT_LT((-residual / step - at.rows.col(i)).norm(), 1e-3 * std::max(1.0, at.rows.norm())) << i;
    }
    for (int i = 0; i < 3; ++i) {
      RcmPrior other = scene.registration;
      other.camera_from_rcm.translation[i] += step;
      const Eigen::Vector2d residual = other.of(scene.unknowns.pose(), least_m).residual;
      EXPECT_LT((residual / step - at.by_rcm_m.col(i)).norm(), 1e-3 * at.by_rcm_m.norm()) << i;
    }
  }
}

// Errors of the RCM that are drawn from the covariance miss the shaft by one sigma in each direction.
TEST(RcmPrior, MissesAreInUnitsOfTheirSigma) {
  Random random(5);
  const Scene scene(random);
  constexpr int draws = 4000;
  const RegistrationMatrix root = scene.registration.covariance.llt().matrixL();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (int draw = 0; draw < draws; ++draw) {
    RcmPrior off = scene.registration;
    off.camera_from_rcm.translation += (root * normal_vector(random)).head<3>();
    const Eigen::Vector2d residual = off.of(scene.unknowns.pose(), 0).residual;
    squares += residual * residual.transpose() / draws;
  }
  EXPECT_LT((squares - Eigen::Matrix2d::Identity()).norm(), 0.1);
}

TEST(RcmPrior, LiesOnTheProximalSideOfEveryShaft) {
  Random random(7);
  const Scene scene(random);
  EXPECT_TRUE(scene.registration.of(scene.unknowns.pose(), 1e-4).is_proximal);
  ShaftPose reversed = scene.unknowns.pose();
  reversed.camera_from_unrolled.rotation = reversed.camera_from_unrolled.rotation * rotation_by({pi, 0, 0});
  EXPECT_FALSE(scene.registration.of(reversed, 1e-4).is_proximal);
}

TEST(RcmPrior, IsKnownToARadiusOrNot) {
  RcmPrior registration;
  EXPECT_TRUE(registration.is_within(1e-6)) << "exact";
  registration.covariance.diagonal().head<3>().setConstant(1e-6);
  EXPECT_TRUE(registration.is_within(2e-3));
  EXPECT_FALSE(registration.is_within(1.5e-3));
}

// For a pose and a registration whose errors are correlated.
TEST(ConfigurationEstimate, HasTheSpreadOfWhatIsDrawn) {
  Random random(9);
  const Scene scene(random);
  constexpr int draws = 4000;
  Eigen::Matrix<double, 12, 12> root;
  for (double& number : root.reshaped()) number = 1e-5 * random.normal();
  const Eigen::Matrix<double, 12, 12> covariance = root * root.transpose();
  RcmPrior registration = scene.registration;
  registration.covariance = covariance.bottomRightCorner<6, 6>();
  const auto estimate = configuration_estimate(scene.unknowns, covariance.topLeftCorner<6, 6>(), registration,
                                               covariance.topRightCorner<6, 6>());
  ASSERT_TRUE(estimate);
  EXPECT_LT((estimate->q.vector() - scene.q.vector()).norm(), 1e-9);
  Eigen::Matrix4d squares = Eigen::Matrix4d::Zero();
  for (int draw = 0; draw < draws; ++draw) {
    Eigen::Matrix<double, 12, 1> normal;
    for (double& number : normal) number = random.normal();
    const Eigen::Matrix<double, 12, 1> error = root * normal;
    const Rigid3& exact = registration.camera_from_rcm;
    const Rigid3 off{rotation_by(error.tail<3>()) * exact.rotation, exact.translation + error.segment<3>(6)};
    const auto q = configuration_of(scene.unknowns.changed_by(error.head<6>()).pose(), off);
    ASSERT_TRUE(q);
    const Eigen::Vector4d change = configuration_change(scene.q, *q);
    squares += change * change.transpose() / draws;
  }
  for (Eigen::Index i = 0; i < 4; ++i) EXPECT_NEAR(std::sqrt(squares(i, i) / estimate->covariance(i, i)), 1, 0.05) << i;
}

}  // namespace lapservo::internal::rcm_prior_test
