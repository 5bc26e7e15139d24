#include "lapservo/robot/joint_path.h"

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

constexpr double period_s = 1.0 / 60;
const Eigen::Vector4d rate(0.4, 0.4, 0.04, 1.5), acceleration(2, 2, 0.2, 7.5);

Eigen::Vector4d random_vector(Random& random) {
  return {random.normal(), random.normal(), random.normal(), random.normal()};
}

TEST(JointPath, PathIsSmoothAtTheArmsRate) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    JointPath path(acceleration);
    path.reset(0, random_vector(random));
    constexpr double tick_s = 0.0005;
    MotionState before = path.at(0);
    for (int k = 0; k < 60; ++k) {
      const Eigen::Vector4d velocity = random_vector(random), last = path.end().velocity;
      path.ramp_to(k * period_s, velocity, period_s);
      const double max_rate = velocity.cwiseAbs().cwiseMax(last.cwiseAbs()).maxCoeff();
      for (double t = k * period_s + tick_s; t < (k + 1) * period_s; t += tick_s) {
        const MotionState now = path.at(t);
        EXPECT_LE(now.velocity.cwiseAbs().maxCoeff(), max_rate + 1e-12);
        // The velocity is the position's derivative, and both are continuous.
        const Eigen::Vector4d mean = (now.velocity + before.velocity) / 2;
        EXPECT_LT((now.position - before.position).cwiseAbs().maxCoeff(), 1.5 * tick_s * (max_rate + 0.1));
        if (t > k * period_s + 1.5 * tick_s) {
          EXPECT_LT(((now.position - before.position) / tick_s - mean).norm(), 1e-6);
        }
        before = now;
      }
      EXPECT_TRUE(path.end().velocity.isApprox(velocity, 1e-12));
    }
  }
}

TEST(JointPath, CoversTheMeanVelocityTimesThePeriod) {
  JointPath path(acceleration);
  path.reset(1, Eigen::Vector4d::Zero());
  path.ramp_to(1, Eigen::Vector4d::Ones(), 0.1);
  EXPECT_NEAR(path.end().position[0], 0.05, 1e-12);
  path.ramp_to(1.1, Eigen::Vector4d::Zero(), 0.1);
  EXPECT_NEAR(path.end().position[0], 0.1, 1e-12);
}

TEST(JointPath, GoesOnFromAnotherPlaceAsFastAsItWas) {
  JointPath path(acceleration);
  path.reset(0, Eigen::Vector4d::Zero());
  path.ramp_to(0, rate, 0.3);
  const Eigen::Vector4d velocity = path.at(0.2).velocity;
  path.move_to(0.2, Eigen::Vector4d::Ones());
  EXPECT_EQ(path.at(0.2).position, Eigen::Vector4d::Ones());
  EXPECT_EQ(path.at(0.2).velocity, velocity);
}

TEST(JointPath, BrakesWhenTheControllerIsLate) {
  JointPath path(acceleration);
  path.reset(0, Eigen::Vector4d::Zero());
  path.ramp_to(0, rate, 0.3);
  MotionState before = path.at(0.3);
  constexpr double tick_s = 0.001;
  for (double t = 0.3 + tick_s; t < 1; t += tick_s) {
    const MotionState now = path.at(t);
    const Eigen::Vector4d change = (now.velocity - before.velocity).cwiseAbs() / tick_s;
    EXPECT_LE((change - acceleration).maxCoeff(), 1e-6) << t;
    EXPECT_LT((now.position - before.position - tick_s * (now.velocity + before.velocity) / 2).norm(), 1e-5) << t;
    before = now;
  }
  EXPECT_TRUE(before.velocity.isZero());
  // Taken up again in the middle of braking, the path goes on from where it is.
  const MotionState braking = path.at(0.35);
  path.ramp_to(0.35, rate, 0.1);
  EXPECT_TRUE(path.at(0.35).position.isApprox(braking.position, 1e-12));
  EXPECT_TRUE(path.at(0.35).velocity.isApprox(braking.velocity, 1e-12));
}

}  // namespace
}  // namespace lapservo::internal
