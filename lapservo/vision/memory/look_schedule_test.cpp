#include "lapservo/vision/memory/look_schedule.h"

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

int looks_in(int frames, Processing answer, bool fully) {
  LookSchedule schedule;
  int looks = 0;
  for (int i = 0; i < frames; ++i) {
    if (!schedule.is_due()) {
      schedule.passed();
      continue;
    }
    ++looks;
    schedule.looked(answer, fully);
  }
  return looks;
}

TEST(LookSchedule, LooksInEachFrameOfACameraThatProcessesItsPictures) {
  EXPECT_EQ(looks_in(100, Processing::found, true), 100);
}

TEST(LookSchedule, LooksNowAndThenAtACameraThatDoesNot) {
  EXPECT_EQ(looks_in(160, Processing::none, false), 10);
}

TEST(LookSchedule, GoesOnInEachFrameAfterALookThatWasNotDue) {
  LookSchedule schedule;
  schedule.looked(Processing::none, false);
  schedule.looked(Processing::found, true);
  EXPECT_TRUE(schedule.is_due());
}

TEST(LookSchedule, RepeatsAQuickLookUntilItAnswers) {
  EXPECT_EQ(looks_in(100, Processing::unknown, false), 100);
}

TEST(LookSchedule, RepeatsAFullLookWithoutAnAnswerAfterTwiceAsLong) {
  EXPECT_EQ(looks_in(1, Processing::unknown, true), 1);
  EXPECT_EQ(looks_in(3, Processing::unknown, true), 2);
  EXPECT_EQ(looks_in(6, Processing::unknown, true), 3);
  EXPECT_LE(looks_in(6500, Processing::unknown, true), 107);
  EXPECT_GE(looks_in(6500, Processing::unknown, true), 100);
}

TEST(LookSchedule, AnAnswerEndsThePauses) {
  LookSchedule schedule;
  for (int i = 0; i < 4; ++i) {
    while (!schedule.is_due()) schedule.passed();
    schedule.looked(Processing::unknown, true);
  }
  while (!schedule.is_due()) schedule.passed();
  schedule.looked(Processing::found, true);
  EXPECT_TRUE(schedule.is_due());
  schedule.looked(Processing::unknown, true);
  schedule.passed();
  EXPECT_TRUE(schedule.is_due());
}

}  // namespace
}  // namespace lapservo::internal
