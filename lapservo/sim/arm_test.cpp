#include "lapservo/sim/arm.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/error.h"
#include "lapservo/core/random.h"

namespace lapservo::internal::arm_test {

const Eigen::Vector4d start(0.1, 1.5, 0.1, 0);

ArmConfig ideal() {
  ArmConfig config;
  config.lag_s = 0;
  config.resolution = config.backlash = config.joint_offset = Eigen::Vector4d::Zero();
  return config;
}

TEST(Arm, FollowsASmallStepWithItsTimeConstant) {
  ArmConfig config = ideal();
  config.lag_s = 0.03;
  Arm arm(config, start);
  const Eigen::Vector4d step = 0.5 * config.lag_s * config.rate;  // too small to reach the largest speed
  arm.servo_jp(start + step);
  for (int k = 1; k <= 100; ++k) {
    arm.step(0.001);
    const Eigen::Vector4d left = (start + step - arm.measured_jp()).cwiseQuotient(step);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(left[i], std::exp(-0.001 * k / config.lag_s), 1e-9);
  }
}

TEST(Arm, NeverExceedsItsRatesOrItsLimits) {
  const std::uint64_t seed = 4;
  Random random(seed);
  for (const double lag_s : {0.0, 0.02, 0.2}) {
    ArmConfig config = ideal();
    config.lag_s = lag_s;
    Arm arm(config, start);
    Eigen::Vector4d before = arm.measured_jp(), farthest = config.lower;
    for (int k = 0; k < 3000; ++k) {
      if (k % 20 == 0) {
        const Eigen::Vector4d goal(random.uniform(-3, 3), random.uniform(-1, 4), random.uniform(-0.2, 0.5),
                                   random.uniform(-9, 9));
        arm.servo_jp(goal);
        farthest = farthest.cwiseMax(goal);
      }
      const double dt_s = random.uniform(1e-4, 0.02);
      arm.step(dt_s);
      const Eigen::Vector4d now = arm.measured_jp();
      for (int i = 0; i < 4; ++i) {
        ASSERT_LE(std::abs(now[i] - before[i]), config.rate[i] * dt_s * (1 + 1e-9))
            << "seed " << seed << " joint " << i;
        ASSERT_GE(now[i], config.lower[i]);
        ASSERT_LE(now[i], config.upper[i]);
      }
      before = now;
    }
    EXPECT_TRUE((farthest.array() > config.upper.array()).all()) << "the test's own power";
  }
}

// Driven to and fro, the instrument stands apart by the whole backlash at the same measured joint.
TEST(Arm, BacklashIsAsWideAsConfigured) {
  ArmConfig config = ideal();
  config.backlash = {0.001, 0.002, 1e-4, 0.02};
  Arm arm(config, start);
  const auto come_from = [&](double side) {
    arm.servo_jp(start + side * 5 * config.backlash);
    arm.step(1);
    arm.servo_jp(start);
    arm.step(1);
    return arm.true_jp();
  };
  const Eigen::Vector4d from_above = come_from(1), from_below = come_from(-1);
  EXPECT_LT((from_above - from_below - config.backlash).norm(), 1e-12);
  // Within the backlash the instrument stays.
  arm.servo_jp(start - 0.9 * config.backlash);
  arm.step(1);
  EXPECT_LT((arm.true_jp() - from_below).norm(), 1e-12);
}

TEST(Arm, ReadsInWholeStepsOfItsEncodersAndStandsOffByItsOffsets) {
  ArmConfig config;
  config.backlash.setZero();
  Arm arm(config, start);
  Random random(8);
  for (int k = 0; k < 100; ++k) {
    arm.servo_jp(start + Eigen::Vector4d(random.uniform(), random.uniform(), 0.1 * random.uniform(), random.uniform()));
    arm.step(0.013);
    const Eigen::Vector4d measured = arm.measured_jp(), steps = measured.cwiseQuotient(config.resolution);
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(steps[i], std::round(steps[i]), 1e-6);
    const Eigen::Vector4d rounding = arm.true_jp() - measured - config.joint_offset;
    for (int i = 0; i < 4; ++i) EXPECT_LE(std::abs(rounding[i]), 0.5001 * config.resolution[i]);
  }
}

TEST(Arm, ANonFiniteSetpointStopsItUntilItRecovers) {
  Arm arm(ideal(), start);
  arm.servo_jp(start + Eigen::Vector4d::Constant(0.05));
  arm.step(0.01);
  const Eigen::Vector4d there = arm.measured_jp();
  arm.servo_jp({NAN, 1.5, 0.1, 0});
  EXPECT_TRUE(arm.faulted());
  arm.servo_jp(start);
  arm.step(1);
  EXPECT_EQ(arm.measured_jp(), there);
  arm.recover();
  arm.servo_jp(start);
  arm.step(1);
  EXPECT_LT((arm.measured_jp() - start).norm(), 1e-12);
}

TEST(Arm, RefusesNonsense) {
  ArmConfig config;
  config.rate[2] = 0;
  EXPECT_THROW(Arm(config, start), InputError);
  EXPECT_THROW(Arm(ArmConfig{}, {9, 1.5, 0.1, 0}), InputError);
}

}  // namespace lapservo::internal::arm_test
