#include "lapservo/crtk/stamp_clock.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace stamp_clock_test {

constexpr double epoch_s = 1.7e9, period_s = 0.01;

TEST(StampClock, TimesAreThoseOfTheFastestMessageAndNeverRunBackwards) {
  Random random(1);
  StampClock clock(0.05);
  double last_s = 0;
  for (int k = 0; k < 1000; ++k) {
    const double sent_s = 5 + k * period_s, travel_s = 0.002 + 0.01 * std::abs(std::sin(random.normal()));
    const auto measured = clock.read(epoch_s + sent_s, sent_s + travel_s);
    ASSERT_EQ(measured.verdict, StampVerdict::fresh) << k;
    EXPECT_LE(measured.time_s, sent_s + travel_s + 1e-6);
    EXPECT_GE(measured.time_s, last_s);
    if (k > 200) {
      EXPECT_NEAR(measured.time_s, sent_s + 0.002, 0.002) << k;
    }
    last_s = measured.time_s;
  }
}

TEST(StampClock, RepeatedReorderedLateAndMissingStampsAreTold) {
  StampClock clock(0.05);
  EXPECT_EQ(clock.read(epoch_s, 1).verdict, StampVerdict::fresh);
  EXPECT_EQ(clock.read(epoch_s, 1.01).verdict, StampVerdict::repeated);
  EXPECT_EQ(clock.read(epoch_s, 9).verdict, StampVerdict::repeated);  // however long it stands still
  EXPECT_EQ(clock.read(epoch_s - 0.01, 9.01).verdict, StampVerdict::repeated);
  StampClock other(0.05);
  EXPECT_EQ(other.read(epoch_s, 1).verdict, StampVerdict::fresh);
  EXPECT_EQ(other.read(epoch_s + 0.01, 1.2).verdict, StampVerdict::late);
  EXPECT_EQ(other.read(epoch_s + 0.21, 1.211).verdict, StampVerdict::fresh);
  for (const double none : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()})
    EXPECT_EQ(other.read(none, 1.3).verdict, StampVerdict::unusable);
}

TEST(StampClock, AClockThatWasSetCostsOneMessage) {
  for (const double jump_s : {3600.0, -3600.0, 1.0, -1.0}) {
    SCOPED_TRACE(jump_s);
    StampClock clock(0.05);
    for (int k = 0; k < 10; ++k)
      EXPECT_EQ(clock.read(epoch_s + k * period_s, 1 + k * period_s).verdict, StampVerdict::fresh);
    EXPECT_EQ(clock.read(epoch_s + jump_s + 10 * period_s, 1 + 10 * period_s).verdict, StampVerdict::jumped);
    const auto measured = clock.read(epoch_s + jump_s + 11 * period_s, 1 + 11 * period_s);
    EXPECT_EQ(measured.verdict, StampVerdict::fresh);
    EXPECT_NEAR(measured.time_s, 1 + 11 * period_s, 1e-6);
  }
}

// A pause of the network: what was stored on the way is late, what was sent after it is fresh.
TEST(StampClock, APauseIsNoJump) {
  StampClock clock(0.05);
  EXPECT_EQ(clock.read(epoch_s, 1).verdict, StampVerdict::fresh);
  EXPECT_EQ(clock.read(epoch_s + 0.01, 2).verdict, StampVerdict::late);
  EXPECT_EQ(clock.read(epoch_s + 1, 2.0001).verdict, StampVerdict::fresh);
}

}  // namespace stamp_clock_test
}  // namespace lapservo::internal
