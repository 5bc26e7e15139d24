#include "lapservo/crtk/stamp_clock.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::stamp_clock_test {

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
  for (const double pause_s : {0.2, 1.0}) {  // what was stored on the way is late, what was sent after it is fresh
    StampClock other(0.05);
    EXPECT_EQ(other.read(epoch_s, 1).verdict, StampVerdict::fresh);
    EXPECT_EQ(other.read(epoch_s + 0.01, 1 + pause_s).verdict, StampVerdict::late);
    EXPECT_EQ(other.read(epoch_s + pause_s + 0.01, 1.011 + pause_s).verdict, StampVerdict::fresh);
    for (const double none : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()})
      EXPECT_EQ(other.read(none, 1.1 + pause_s).verdict, StampVerdict::unusable);
  }
}

// Steps of any size, either way: a short hold, then times as accurate as before. Steps within disorder and lateness
// need no hold.
TEST(StampClock, AClockThatWasSetCostsTwoMessages) {
  for (const double size_s : {1e-4, 0.005, 0.03, 0.07, 0.1, 0.2, 0.24, 0.3, 1.0, 3600.0, 1e8})
    for (const double step_s : {size_s, -size_s}) {
      SCOPED_TRACE(step_s);
      StampClock clock(0.05);
      for (int k = 0; k < 10; ++k)
        ASSERT_EQ(clock.read(epoch_s + k * period_s, 1 + k * period_s).verdict, StampVerdict::fresh);
      int dropped = 0, jumped = 0;
      for (int k = 10; k < 300; ++k) {
        const double now_s = 1 + k * period_s;
        const auto measured = clock.read(epoch_s + step_s + k * period_s, now_s);
        dropped += measured.verdict != StampVerdict::fresh;
        jumped += measured.verdict == StampVerdict::jumped;
        if (measured.verdict != StampVerdict::fresh) continue;
        EXPECT_LE(measured.time_s, now_s + 1e-6);
        EXPECT_GE(measured.time_s, now_s - 0.05);
      }
      EXPECT_LE(dropped, 2);
      EXPECT_EQ(jumped, step_s > 0.25 || step_s < -0.02 ? 1 : 0);
    }
}

// As the dVRK's: the same stamp twice, back by 0.03 ms, and an old message now and then.
TEST(StampClock, OldMessagesAndDisorderAreNoJump) {
  StampClock clock(0.05);
  for (int k = 0; k < 1000; ++k) {
    const double now_s = 1 + k * period_s;
    ASSERT_EQ(clock.read(epoch_s + now_s, now_s).verdict, StampVerdict::fresh) << k;
    EXPECT_EQ(clock.read(epoch_s + now_s - (k % 2 ? 0 : 3e-5), now_s + 1e-3).verdict, StampVerdict::repeated);
    if (k % 10 == 0) {
      EXPECT_EQ(clock.read(epoch_s + now_s - 5, now_s + 2e-3).verdict, StampVerdict::repeated);
    }
  }
}

// Set back while nothing came, which is seen as a longer way: held for a second, not for minutes.
TEST(StampClock, AWayThatStaysLongerCountsAfterASecond) {
  StampClock clock(0.05);
  ASSERT_EQ(clock.read(epoch_s, 1).verdict, StampVerdict::fresh);
  int late = 0;
  for (int k = 0; k < 300; ++k) {
    const double now_s = 3 + k * period_s;
    const auto verdict = clock.read(epoch_s + now_s - 1 - 0.2, now_s).verdict;
    late += verdict == StampVerdict::late;
    if (k > 102) {
      EXPECT_EQ(verdict, StampVerdict::fresh) << k;
    }
  }
  EXPECT_NEAR(late, 100, 2);
}

// A computer that is overloaded: none of its late messages counts, however long it lasts.
TEST(StampClock, AWayThatVariesStaysLate) {
  StampClock clock(0.05);
  ASSERT_EQ(clock.read(epoch_s, 1).verdict, StampVerdict::fresh);
  for (int k = 0; k < 1000; ++k) {
    const double now_s = 3 + k * period_s, travel_s = 0.2 + 0.1 * std::sin(0.05 * k);
    const auto verdict = clock.read(epoch_s + now_s - 1 - travel_s, now_s).verdict;
    EXPECT_TRUE(verdict == StampVerdict::late || verdict == StampVerdict::repeated) << k;
  }
}

}  // namespace lapservo::internal::stamp_clock_test
