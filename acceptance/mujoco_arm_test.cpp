#include "acceptance/mujoco_arm.h"

#include <cmath>

#include <gtest/gtest.h>

namespace lapservo::internal::mujoco_arm_test {

const Eigen::Vector4d start(0.05, 1.57, 0.1, 1.2);
const Eigen::Vector4d small(1e-4, 1e-4, 1e-5, 2e-3);  // beside a motion of a few mrad or tenths of a mm

MujocoArmConfig exact_encoders() {
  MujocoArmConfig config;
  config.joints.resolution.setZero();
  return config;
}

TEST(MujocoArm, BearsItsWeightWhereItStarts) {
  MujocoArm arm(exact_encoders(), start);
  const Eigen::Vector4d truth = arm.true_jp(), weight = (arm.setpoint() - start);
  arm.step(2);
  EXPECT_TRUE(((arm.measured_jp() - start).cwiseAbs().array() < 0.1 * small.array()).all());
  EXPECT_TRUE(((arm.true_jp() - truth).cwiseAbs().array() < 0.1 * small.array()).all());
  EXPECT_GT(std::abs(weight[1]), 5e-4);  // the carriage about the RCM,
  EXPECT_LT(weight[2], -3e-4);           // and down along the shaft
  EXPECT_TRUE(arm.true_jp().isApprox(start + exact_encoders().joints.joint_offset, 0.02));
}

// Setpoint to motor: friction over gain to either side; motor to instrument: the backlash beside it.
TEST(MujocoArm, StandsStillWithinFrictionAndBacklash) {
  const MujocoArmConfig config = exact_encoders();
  const Eigen::Vector4d stuck = config.friction.cwiseQuotient(config.proportional_gain);
  for (int joint = 0; joint < 4; ++joint) {
    SCOPED_TRACE(joint);
    MujocoArm arm(config, start);
    const auto go = [&](double by, double duration_s) {
      Eigen::Vector4d setpoint = arm.setpoint();
      const double from = setpoint[joint];
      for (int k = 1; k <= 100; ++k) {
        setpoint[joint] = from + by * k / 100;
        arm.servo_jp(setpoint);
        arm.step(duration_s / 100);
      }
      arm.step(0.5);
    };
    go(20 * stuck[joint], 1);
    const double measured = arm.measured_jp()[joint], truth = arm.true_jp()[joint];
    go(-1.8 * stuck[joint], 1);
    EXPECT_NEAR(arm.measured_jp()[joint], measured, 0.1 * stuck[joint]);
    go(-20 * stuck[joint], 1);
    EXPECT_NEAR(arm.measured_jp()[joint], measured - 19.8 * stuck[joint], 0.3 * stuck[joint]);
    EXPECT_NEAR(arm.true_jp()[joint] - truth, arm.measured_jp()[joint] - measured,
                config.joints.backlash[joint] + small[joint]);
  }
}

TEST(MujocoArm, LagsByItsDamping) {
  const MujocoArmConfig config = exact_encoders();
  MujocoArm arm(config, start);
  const Eigen::Vector4d rate(0.2, -0.2, 0.02, 1), from = arm.setpoint();
  for (int k = 1; k <= 500; ++k) {
    arm.servo_jp(from + rate * 0.001 * k);
    arm.step(0.001);
  }
  const Eigen::Vector4d lag = config.derivative_gain.cwiseQuotient(config.proportional_gain);
  const Eigen::Vector4d stuck = config.friction.cwiseQuotient(config.proportional_gain);
  const Eigen::Vector4d behind = (arm.setpoint() - arm.measured_jp()) - (from - start);
  for (int i = 0; i < 4; ++i)
    EXPECT_NEAR(behind[i], rate[i] * lag[i] + std::copysign(stuck[i], rate[i]), 0.1 * std::abs(behind[i])) << i;
}

}  // namespace lapservo::internal::mujoco_arm_test
