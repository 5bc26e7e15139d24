#include "lapservo/control/arm_lag.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

constexpr double period_s = 1.0 / 60;

/// An arm of first order behind sinusoidal setpoints, read with noise.
double lag_found(double lag_s, double amplitude, std::uint64_t seed) {
  Random random(seed);
  ArmLag lag{Scales{}};
  Eigen::Vector4d arm = Eigen::Vector4d::Zero();
  for (int k = 0; k < 1200; ++k) {
    const double t = k * period_s;
    const Eigen::Vector4d size = amplitude * Scales{}.joints;
    const MotionState setpoint{size * std::sin(t), size * std::cos(t)};
    arm = lag_s > 0 ? Eigen::Vector4d(setpoint.position + (arm - setpoint.position) * std::exp(-period_s / lag_s))
                    : setpoint.position;
    Eigen::Vector4d measured = arm;
    for (int i = 0; i < 4; ++i) measured[i] += 1e-4 * Scales{}.joints[i] * random.normal();
    lag.add(setpoint, measured, period_s);
  }
  return lag.seconds();
}

TEST(ArmLag, IsFoundFromMotion) {
  for (const double lag_s : {0.0, 0.01, 0.03, 0.06}) {
    // The arm of this test follows the setpoint at the end of each period: half a period less than a continuous one.
    const double expected_s = lag_s > 0 ? std::exp(-period_s / lag_s) * period_s / -std::expm1(-period_s / lag_s) : 0;
    EXPECT_NEAR(lag_found(lag_s, 0.5, 3), expected_s, 0.05 * expected_s + 5e-4);
  }
}

TEST(ArmLag, IsZeroWithoutMotionAndBounded) {
  EXPECT_LT(lag_found(0.05, 0, 4), 1e-3);
  EXPECT_LE(lag_found(2, 0.5, 5), 0.1);
}

}  // namespace
}  // namespace lapservo::internal
