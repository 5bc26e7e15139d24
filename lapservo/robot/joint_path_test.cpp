#include "lapservo/robot/joint_path.h"

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::joint_path_test {

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

TEST(JointPath, GoesOnFromAnotherPlaceAsFastAsItWas) {
  JointPath path(acceleration);
  path.reset(0, Eigen::Vector4d::Zero());
  path.ramp_to(0, rate, 0.3);
  const Eigen::Vector4d velocity = path.at(0.2).velocity;
  path.move_to(0.2, Eigen::Vector4d::Ones());
  EXPECT_EQ(path.at(0.2).position, Eigen::Vector4d::Ones());
  EXPECT_EQ(path.at(0.2).velocity, velocity);
}

}  // namespace lapservo::internal::joint_path_test
