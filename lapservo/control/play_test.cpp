#include "lapservo/control/play.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace {

// The definition: the instrument stays where it is unless the motor takes it along.
TEST(Play, KeepsTheInstrumentWithinTheGap) {
  Random random(1);
  const double width = 0.3;
  Play play;
  double motor = 0, instrument = 0;
  for (int k = 0; k < 20000; ++k) {
    motor += 0.1 * random.normal();
    instrument = std::clamp(instrument, motor - width / 2, motor + width / 2);
    play.follow(motor, width);
    ASSERT_NEAR(play.instrument(width), instrument, 1e-9) << k;
  }
}

TEST(Play, OfNoWidthIsTheMotor) {
  Random random(2);
  Play play;
  for (int k = 0; k < 1000; ++k) {
    const double motor = random.normal();
    play.follow(motor, 0);
    ASSERT_EQ(play.instrument(0), motor);
  }
}

TEST(Play, FollowsAWidthThatChanges) {
  Play play(0, 1);
  play.follow(1, 0);
  EXPECT_EQ(play.instrument(0.2), 0.9);
  play.follow(0.85, 0.2);
  EXPECT_EQ(play.instrument(0.2), 0.9) << "within the gap";
  play.follow(0.7, 0.2);
  EXPECT_EQ(play.instrument(0.2), 0.7 + 0.1) << "beyond it";
}

}  // namespace
}  // namespace lapservo::internal
