#include "lapservo/control/arm_response.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::arm_response_test {

constexpr double period_s = 1.0 / 60;

MotionState swing_at(double t, double amplitude) {
  return {amplitude * std::sin(t) * Scales{}.joints, amplitude * std::cos(t) * Scales{}.joints};
}

/// An arm of first order behind sinusoidal setpoints, read with noise.
double lag_found(double lag_s, double amplitude, std::uint64_t seed) {
  Random random(seed);
  ArmResponse response{Scales{}};
  Eigen::Vector4d arm = Eigen::Vector4d::Zero();
  for (int k = 0; k < 1200; ++k) {
    const MotionState setpoint = swing_at(k * period_s, amplitude);
    arm = lag_s > 0 ? Eigen::Vector4d(setpoint.position + (arm - setpoint.position) * std::exp(-period_s / lag_s))
                    : setpoint.position;
    Eigen::Vector4d measured = arm;
    for (int i = 0; i < 4; ++i) measured[i] += 1e-4 * Scales{}.joints[i] * random.normal();
    response.add(setpoint, measured, period_s);
  }
  return response.lag_s();
}

TEST(ArmResponse, LagIsFoundFromMotion) {
  for (const double lag_s : {0.0, 0.01, 0.03, 0.06}) {
    // The arm of this test follows the setpoint at the end of each period: half a period less than a continuous one.
    const double expected_s = lag_s > 0 ? std::exp(-period_s / lag_s) * period_s / -std::expm1(-period_s / lag_s) : 0;
    EXPECT_NEAR(lag_found(lag_s, 0.5, 3), expected_s, 0.05 * expected_s + 5e-4);
  }
}

TEST(ArmResponse, LagIsZeroWithoutMotionAndBounded) {
  EXPECT_LT(lag_found(0.05, 0, 4), 1e-3);
  EXPECT_LE(lag_found(2, 0.5, 5), 0.1);
}

// Coulomb friction and gravity before a PD servo: setpoints move `friction` to either side of `load` before joints
// follow.
struct StickingArm {
  Eigen::Vector4d friction{3e-4, 3e-4, 2e-4, 8e-3}, load{-1e-3, 1e-3, -4e-4, 0}, q = Eigen::Vector4d::Zero();
  void follow(const Eigen::Vector4d& setpoint) {
    q = q.cwiseMax(setpoint - load - friction).cwiseMin(setpoint - load + friction);
  }
};

TEST(ArmResponse, FindsFrictionAndLoad) {
  ArmResponse response{Scales{}};
  StickingArm arm;
  for (int k = 0; k < 900; ++k) {
    const MotionState setpoint = swing_at(k * period_s, 0.5);
    arm.follow(setpoint.position);
    response.add(setpoint, arm.q, period_s);
  }
  const auto off = [&](const Eigen::Vector4d& is, const Eigen::Vector4d& truth) {
    return (is - truth).cwiseQuotient(arm.friction).cwiseAbs().maxCoeff();
  };
  EXPECT_LT(off(response.drive().friction, arm.friction), 0.05);
  EXPECT_LT(off(response.drive().load, arm.load), 0.05);
  EXPECT_LT(response.lag_s(), 2e-3);
  response.restart();
  EXPECT_TRUE(response.drive().load.isZero());
  EXPECT_LT(off(response.drive().friction, arm.friction), 0.05);
}

TEST(ArmResponse, LearnsNothingFromABlockedJoint) {
  ArmResponse response{Scales{}};
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector4d velocity = 0.3 * Scales{}.joints;
    response.add({velocity * (k * period_s), velocity}, Eigen::Vector4d::Zero(), period_s);
  }
  EXPECT_EQ(response.lag_s(), 0);
  EXPECT_TRUE(response.drive().load.isZero());
  EXPECT_TRUE(response.drive().friction.isZero());
}

// Neither does the wound-up transmission, an eighth of the way and 40 ms late, when the setpoint slows down at the
// following-error limit.
TEST(ArmResponse, AWoundTransmissionIsNoLoad) {
  constexpr double lag_s = 0.04, wound = 0.125;
  ArmResponse response{Scales{}};
  MotionState setpoint{Eigen::Vector4d::Zero(), Scales{}.joints};
  Eigen::Vector4d motor = Eigen::Vector4d::Zero();
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector4d slower = setpoint.velocity - 10 * period_s * Scales{}.joints;
    setpoint.velocity = slower.cwiseMax(0.01 * Scales{}.joints);
    setpoint.position += period_s * setpoint.velocity;
    motor += -std::expm1(-period_s / lag_s) * (wound * setpoint.position - motor);
    response.add(setpoint, motor, period_s);
  }
  EXPECT_TRUE(response.drive().load.isZero()) << response.drive().load.transpose();
  EXPECT_FALSE(response.drive().load_known[0]);
}

TEST(ArmResponse, KnowsTheLoadOfAJointThatHasGoneBothWays) {
  ArmResponse response{Scales{}};
  StickingArm arm;
  const auto move = [&](double from, double to) {
    for (int k = 0; k < 60; ++k) {
      const Eigen::Vector4d rate = (to - from) * Scales{}.joints;
      const MotionState setpoint{from * Scales{}.joints + rate * (k * period_s), rate};
      arm.follow(setpoint.position);
      response.add(setpoint, arm.q, period_s);
    }
    return response.drive().load_known[0];
  };
  EXPECT_FALSE(move(0, 1));
  EXPECT_TRUE(move(1, 0));
  response.restart();
  EXPECT_FALSE(response.drive().load_known[0]);
  EXPECT_TRUE(move(0, 1));
}

}  // namespace lapservo::internal::arm_response_test
