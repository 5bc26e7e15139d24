#include "lapservo/control/tracking_law.h"

#include <cmath>
#include <optional>

#include <Eigen/SVD>
#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"

namespace lapservo::internal::tracking_law_test {

Eigen::Matrix4d random_matrix(Random& random) {
  Eigen::Matrix4d matrix;
  for (int i = 0; i < 16; ++i) matrix.data()[i] = random.normal();
  return matrix;
}

TEST(TrackingLaw, SampledErrorDecaysExactlyWithVelocityRamped) {
  for (const double decay_per_s : {0.05, 1.0, 20.0}) {
    constexpr double period_s = 0.05;
    const double gain = exact_gain_ramped(decay_per_s, period_s);
    double error = 1, velocity = -gain * std::exp(decay_per_s * period_s);
    for (int k = 1; k <= 40; ++k) {
      const double next = -gain * error;
      error += period_s * (velocity + next) / 2;
      velocity = next;
      EXPECT_NEAR(error, std::exp(-decay_per_s * period_s * k), 1e-12);
    }
  }
}

TEST(TrackingLaw, ErrorOfTheAngleTakesTheShorterWay) {
  const Eigen::Vector4d features(3.1, 10, 20, 30), desired(-3.1, 9, 22, 30);
  const Eigen::Vector4d error = feature_error(features, desired);
  EXPECT_NEAR(error[0], 6.2 - two_pi, 1e-12);
  EXPECT_TRUE(error.tail<3>().isApprox(Eigen::Vector3d(1, -2, 0)));
}

TEST(TrackingLaw, PaperGainsAreReadPerControlPeriod) {
  EXPECT_TRUE(paper_gains(0.001).per_s.isApprox(Eigen::Vector4d(32, 8, 0.8, 10), 1e-12));
  EXPECT_TRUE(paper_gains(1.0 / 60).per_s.isApprox(Eigen::Vector4d(1.92, 0.48, 0.048, 0.6), 1e-12));
}

TEST(TrackingLaw, PaperVelocityMovesTheFeaturesAsWanted) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Eigen::Matrix4d jacobian = random_matrix(random);
    const Eigen::Vector4d features = random_matrix(random).col(0), desired = random_matrix(random).col(0);
    const Eigen::Vector4d rate = random_matrix(random).col(0);
    const TrackingGains gains{{1, 2, 3, 4}};
    const Eigen::Vector4d moved = jacobian * paper_velocity(jacobian, gains, features, desired, rate);
    EXPECT_TRUE(moved.isApprox(wanted_feature_rate(gains, features, desired, rate), 1e-8));
  }
}

TEST(DampedInverse, IsTheInverseAwayFromSingularities) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    const Scales scales{{0.005, 1, 2, 3}, {0.1, 0.2, 0.01, 0.3}};
    const Eigen::Matrix4d scaled = random_matrix(random);
    const Eigen::Matrix4d jacobian = scales.features.asDiagonal() * scaled * scales.joints.cwiseInverse().asDiagonal();
    const double smallest = scaled.jacobiSvd().singularValues()[3];
    const auto damped = damped_inverse(jacobian, scales, 0.9 * smallest);
    EXPECT_NEAR(damped.min_singular_value, smallest, 1e-9 * (1 + smallest));
    EXPECT_TRUE((damped.inverse * jacobian).isApprox(Eigen::Matrix4d::Identity(), 1e-6));
  }
}

TEST(DampedInverse, StaysBoundedAndContinuousThroughSingularities) {
  constexpr double threshold = 0.5;
  Random random(3);
  const Scales unit{Eigen::Vector4d::Ones(), Eigen::Vector4d::Ones()};
  const Eigen::JacobiSVD<Eigen::Matrix4d> axes(random_matrix(random), Eigen::ComputeFullU | Eigen::ComputeFullV);
  std::optional<Eigen::Matrix4d> before;
  for (double sigma = 1; sigma > -1e-9; sigma -= 0.001) {
    const Eigen::Vector4d singular(3, 2, 1, std::max(sigma, 0.0));
    const Eigen::Matrix4d jacobian = axes.matrixU() * singular.asDiagonal() * axes.matrixV().transpose();
    const Eigen::Matrix4d inverse = damped_inverse(jacobian, unit, threshold).inverse;
    EXPECT_LE(inverse.jacobiSvd().singularValues()[0], 1 / threshold + 1e-9) << sigma;
    if (before) {
      EXPECT_LT((inverse - *before).norm(), 0.01) << sigma;
    }
    before = inverse;
  }
}

}  // namespace lapservo::internal::tracking_law_test
