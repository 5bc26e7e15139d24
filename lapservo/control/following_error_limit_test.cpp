#include "lapservo/control/following_error_limit.h"

#include <cmath>

#include <gtest/gtest.h>

namespace lapservo::internal::following_error_limit_test {

constexpr double period_s = 1.0 / 60, lag_s = 0.03;
const JointLimits limits;
const Eigen::Vector4d q(0, 1, 0.1, 0), change = limits.acceleration * period_s;

// A setpoint whose velocities are limited; they keep to rate and acceleration.
struct Limited {
  FollowingErrorLimit limit{limits};
  MotionState setpoint{q, Eigen::Vector4d::Zero()};

  Eigen::Vector4d move(const Eigen::Vector4d& wanted, const Eigen::Vector4d& joint, const DriveState& drive) {
    limit.update(setpoint, joint, drive, lag_s, period_s);
    const Eigen::Matrix4d weight = limits.rate.cwiseAbs2().cwiseInverse().asDiagonal();
    const Eigen::Vector4d velocity =
        limit_velocity(limits, {}, setpoint, {}, wanted, weight, period_s, limit.range(limits.rate)).velocity;
    setpoint.position += period_s * (setpoint.velocity + velocity) / 2;
    setpoint.velocity = velocity;
    return velocity;
  }
  Eigen::Vector4d slower() const { return setpoint.velocity - setpoint.velocity.cwiseMax(-change).cwiseMin(change); }
  Eigen::Vector4d faster() const { return limits.rate.cwiseMin(setpoint.velocity + change); }
};

// Setpoints at full speed, joints that follow with their lag, then stand. The load of one that has not gone both ways
// may be off by its friction, in whose direction nobody knows.
TEST(FollowingErrorLimit, LeavesAnArmThatFollowsAloneAndComesBackToOneThatStands) {
  Limited limited;
  const MotionState& setpoint = limited.setpoint;
  DriveState drive;
  drive.load << 0.001, -0.001, 0.0005, 0.01;
  drive.load_known = {true, false, true, false};
  Eigen::Vector4d joint = q, farthest = Eigen::Vector4d::Zero();
  for (int k = 0; k < 240; ++k) {
    const bool stands = k >= 60;
    const Eigen::Vector4d before = joint, wanted = limited.faster(), velocity = limited.move(wanted, joint, drive);
    EXPECT_LE(stands ? 0 : (velocity - wanted).norm(), 1e-12) << k;
    if (k < 75 || k > 120) {
      EXPECT_EQ(limited.limit.is_reached(), k > 120) << k;
    }
    if (!stands) joint += -std::expm1(-period_s / lag_s) * (setpoint.position - drive.load - joint);
    drive.velocity = (joint - before) / period_s;
    drive.follows.fill(!stands);
    farthest = farthest.cwiseMax(setpoint.position - drive.load - joint);
  }
  const Eigen::Vector4d stopping = limits.rate.cwiseAbs2().cwiseQuotient(2 * limits.acceleration);
  EXPECT_LE((farthest - stopping - limits.rate * (lag_s + 2 * period_s)).maxCoeff(), 0);
  const Eigen::Vector4d ahead = (setpoint.position - drive.load - joint).cwiseQuotient(lag_s * limits.rate);
  EXPECT_TRUE(ahead.isApprox(Eigen::Vector4d(0.9, 0.7, 0.9, 0.7), 0.01)) << ahead.transpose();
}

// An arm that hangs far below its setpoints follows them nevertheless: it is not pulled down step by step.
TEST(FollowingErrorLimit, DoesNotTakeALoadForABlockedJoint) {
  Limited limited;
  const MotionState& setpoint = limited.setpoint;
  DriveState drive;
  const Eigen::Vector4d sag = 5 * lag_s * limits.rate;
  Eigen::Vector4d joint = q - sag;
  for (int k = 0; k < 240; ++k) {
    const Eigen::Vector4d before = joint, velocity = limited.move(limited.slower(), joint, drive);
    joint += -std::expm1(-period_s / lag_s) * (setpoint.position - sag - joint);
    drive.velocity = (joint - before) / period_s;
    for (int i = 0; i < 4; ++i)
      drive.follows[static_cast<std::size_t>(i)] =
          velocity[i] < -0.02 * limits.rate[i] && drive.velocity[i] < 0.7 * velocity[i];
  }
  EXPECT_LE((q - setpoint.position - sag).maxCoeff(), 0);
  EXPECT_LE(setpoint.velocity.norm(), 1e-3);
}

}  // namespace lapservo::internal::following_error_limit_test
