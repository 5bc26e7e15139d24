#include "lapservo/control/calibration_motion.h"

#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/core/random.h"

namespace lapservo::internal::calibration_motion_test {

constexpr int seed = 20261122;
constexpr double step_s = 0.01;

void expect_gentle(const JointMotion& motion, const Eigen::Vector4d& start, const JointLimits& limits) {
  EXPECT_LT((motion.at(0) - start).norm(), 1e-12);
  Eigen::Vector4d before = motion.at(0), rate_before = Eigen::Vector4d::Zero();
  for (double t = step_s; t <= motion.duration_s + step_s; t += step_s) {
    const Eigen::Vector4d q = motion.at(t), rate = (q - before) / step_s;
    EXPECT_TRUE((q.array() >= limits.lower.array() - 1e-12).all() && (q.array() <= limits.upper.array() + 1e-12).all())
        << t << ": " << q.transpose();
    EXPECT_TRUE((rate.cwiseAbs().array() <= 0.8001 * limits.rate.array()).all()) << t << ": " << rate.transpose();
    EXPECT_TRUE(((rate - rate_before).cwiseAbs().array() <= step_s * limits.acceleration.array()).all()) << t;
    before = q, rate_before = rate;
  }
  EXPECT_LT((motion.at(motion.duration_s) - motion.at(motion.duration_s - step_s)).norm(), 1e-3);
}

Eigen::Vector4d anywhere(const JointLimits& limits, Random& random) {
  Eigen::Vector4d q;
  for (int i = 0; i < 4; ++i) q[i] = random.uniform(limits.lower[i], limits.upper[i]);
  return q;
}

TEST(CalibrationMotion, StaysWithinTheLimitsFromAnywhere) {
  Random random(seed);
  for (int i = 0; i < 50; ++i) {
    JointLimits limits;
    limits.acceleration *= random.uniform(0.1, 1.0);
    const Eigen::Vector4d start = anywhere(limits, random);
    expect_gentle(swing_motion(start, limits, random.uniform(0.1, 3.0), random.uniform(1.0, 60.0)), start, limits);
    expect_gentle(turn_motion(start, limits, "limits"), start, limits);
  }
}

TEST(CalibrationMotion, SwingsAsFarAsItsReachAndReturns) {
  const JointLimits limits;
  const Eigen::Vector4d free(0, 1.5, 0.1, 0),
      beside_limits(0, 2.47, 0.03, 0);  // phi 0.03 rad from its limit, rho at it
  EXPECT_TRUE(swing_reach(free, limits, 1, 20).isApprox(Eigen::Vector4d(0.25, 0.2, 0.01, 1)));
  EXPECT_TRUE(swing_reach(beside_limits, limits, 1, 20).isApprox(Eigen::Vector4d(0.25, 0.03, 0, 1)));
  for (const Eigen::Vector4d& start : {free, beside_limits}) {
    const Eigen::Array4d reach = swing_reach(start, limits, 1, 20);
    const JointMotion motion = swing_motion(start, limits, 1, 20);
    Eigen::Array4d most = Eigen::Array4d::Zero();
    for (double t = 0; t < 20; t += step_s) most = most.max((motion.at(t) - start).cwiseAbs().array());
    EXPECT_TRUE((most < reach + 1e-8).all() && (most > 0.8 * reach - 1e-8).all()) << most.transpose();
    EXPECT_LT((motion.at(20) - start).norm(), 1e-12);
  }
}

TEST(CalibrationMotion, SwingsNoTwoJointsAlikeHoweverSlow) {
  const Eigen::Vector4d start(0, 1.5, 0.1, 0);
  for (const double duration_s : {3, 8, 12, 20, 60}) {
    const JointMotion motion = swing_motion(start, {}, 1, duration_s);
    Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
    for (double t = 0; t < duration_s; t += step_s) sum += (motion.at(t) - start) * (motion.at(t) - start).transpose();
    const Eigen::Vector4d size = sum.diagonal().cwiseSqrt();
    sum.diagonal().setZero();
    EXPECT_LT((sum.array() / (size * size.transpose()).array()).abs().maxCoeff(), 0.6) << duration_s;
  }
}

TEST(CalibrationMotion, TurnsOnceAndALittleMoreAndReturns) {
  const JointLimits limits;
  const JointMotion motion = turn_motion({0, 1.5, 0.1, 3.5}, limits, "limits");
  double low = 10, high = -10;
  for (double t = 0; t < motion.duration_s; t += step_s)
    low = std::min(low, motion.at(t)[3]), high = std::max(high, motion.at(t)[3]);
  EXPECT_GT(high - low, 6.5);
  EXPECT_NEAR(motion.at(motion.duration_s)[3], 3.5, 1e-12) << "a swing may need room there";
}

TEST(CalibrationMotion, RefusesATurnWhereThereIsNoRoom) {
  JointLimits limits;
  limits.lower[3] = -2;
  EXPECT_THROW(turn_motion({0, 1.5, 0.1, 0}, limits, "limits.yaml"), InputError);
}

}  // namespace lapservo::internal::calibration_motion_test
