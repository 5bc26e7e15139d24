#include "lapservo/control/gap_crossing.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/robot/backlash.h"

namespace lapservo::internal::gap_crossing_test {

constexpr double period_s = 1.0 / 60;

/// Psi has to fall at a slow, steady rate after it rose: motor and instrument, without noise or lag.
struct Crossing {
  double width = 0.02, motor = 1, velocity = 0;
  Backlash backlash{1, 1};
  JointLimits limits;

  double instrument() const { return backlash.instrument(width); }
  void advance(double wanted) {
    GapState gap;
    gap.width[3] = width;
    gap.shift[3] = instrument() - motor;
    Eigen::Vector4d q(0, 1, 0.1, motor), v(0, 0, 0, velocity), asked(0, 0, 0, wanted);
    const double next = cross_gaps(limits, {q, v}, gap, DriveState{}, q, asked, asked, period_s)[3];
    ASSERT_LE(std::abs(next - velocity), limits.acceleration[3] * period_s + 1e-12);
    ASSERT_LE(std::abs(next), limits.rate[3]);
    motor += (velocity + next) / 2 * period_s;
    velocity = next;
    backlash.follow(motor, width);
  }
};

TEST(CrossGaps, CrossesTheGapFastAndEndsSoftly) {
  Crossing world;
  const double wanted = -0.02;
  double crossed_s = 0;
  for (int k = 1; k <= 60; ++k) {
    world.advance(wanted);
    if (world.instrument() > 0.9899) crossed_s = k * period_s;
    // Once pressed, the instrument does not run ahead of the desired motion.
    EXPECT_GT(world.instrument(), 0.99 + wanted * k * period_s - 0.001) << k;
  }
  EXPECT_LT(crossed_s, 0.25);  // one second by the wanted motion alone
  EXPECT_NEAR(world.velocity, wanted, 1e-3);
}

// The setpoint of a joint at rest moves on beyond load and friction, and no faster once the joint follows.
TEST(CrossGaps, CrossesFriction) {
  const JointLimits limits;
  DriveState drive;
  drive.friction[2] = 2e-4;
  drive.load[2] = -4e-4;
  const Eigen::Vector4d q(0, 1, 0.1, 0), asked(0, 0, 1e-3, 0);
  double position = q[2] - 6e-4, velocity = 0;  // came from above
  int ticks = 0;
  while (position - q[2] < -2e-4 && ++ticks < 60) {
    const MotionState setpoint{{0, 1, position, 0}, {0, 0, velocity, 0}};
    const double next = cross_gaps(limits, setpoint, GapState{}, drive, q, asked, asked, period_s)[2];
    EXPECT_LE(std::abs(next - velocity), limits.acceleration[2] * period_s + 1e-12);
    position += period_s * (velocity + next) / 2;
    velocity = next;
  }
  EXPECT_LT(ticks * period_s, 0.2);  // 0.4 s by the wanted motion alone
  drive.velocity[2] = 1e-3;
  const MotionState setpoint{{0, 1, q[2] - 4e-4, 0}, {0, 0, 1e-3, 0}};
  EXPECT_EQ(cross_gaps(limits, setpoint, GapState{}, drive, q, asked, asked, period_s), asked);
}

TEST(CrossGaps, LeavesAloneWhatHasNoDirection) {
  GapState gap;
  gap.width << 0, 0, 1e-4, 0.02;
  const JointLimits limits;
  const Eigen::Vector4d q(0, 1, 0.1, 0);
  Random random(4);
  for (int k = 0; k < 100; ++k) {
    Eigen::Vector4d noise;
    for (int i = 0; i < 4; ++i) noise[i] = 0.01 * random.normal();
    const MotionState rest{q, Eigen::Vector4d::Zero()};
    EXPECT_EQ(cross_gaps(limits, rest, gap, DriveState{}, q, Eigen::Vector4d::Zero(), noise, period_s), noise)
        << "a setpoint";
    const MotionState elsewhere{q - noise, Eigen::Vector4d::Zero()};
    EXPECT_EQ(cross_gaps(limits, elsewhere, GapState{}, DriveState{}, q, noise, noise, period_s), noise) << "no gap";
    GapState pressed = gap;
    for (int i = 0; i < 4; ++i) pressed.shift[i] = noise[i] > 0 ? -gap.width[i] / 2 : gap.width[i] / 2;
    EXPECT_EQ(cross_gaps(limits, elsewhere, pressed, DriveState{}, q, noise, noise, period_s), noise) << "crossed";
    EXPECT_EQ(cross_gaps(limits, rest, gap, DriveState{}, q, -noise, noise, period_s), noise)
        << "an error that goes against it";
  }
}

}  // namespace lapservo::internal::gap_crossing_test
