#include "lapservo/vision/decision/instrument_memory.h"

#include <gtest/gtest.h>

namespace lapservo::internal::instrument_memory_test {

FineFit fit_at(const JointVector& q) {
  FineFit fit;
  fit.unknowns = {pose_through_rcm({}, q), true};
  return fit;
}

constexpr double psi_0_rad = 0.3, psi_1_rad = 0.4;

// Found in two frames that were taken 40 ms apart.
InstrumentMemory moving() {
  const InstrumentMemory first = remembered(std::nullopt, fit_at({0.1, 1.5, 0.06, psi_0_rad}), 10);
  return remembered(first, fit_at({0.1, 1.5, 0.065, psi_1_rad}), 10.04);
}

TEST(InstrumentMemory, ExpectsAnInstrumentToMoveOn) {
  const InstrumentMemory memory = moving();
  for (const double frames : {0.5, 1.0, 3.0}) {
    const PoseUnknowns expected = memory.expected_pose(10.04 + frames * 0.04);
    EXPECT_NEAR(expected.pose().psi_rad, psi_1_rad + frames * 0.1, 1e-9);
    EXPECT_NEAR(configuration_of(expected.pose(), {})->rho_m, 0.065 + frames * 0.005, 1e-9);
  }
  EXPECT_LT(memory.expected_pose(1e6).pose().psi_rad, psi_1_rad + 0.5);
  EXPECT_EQ(memory.expected_pose(9).pose().psi_rad, psi_1_rad);
  // A turn goes on for as long as the time between.
  EXPECT_NEAR(memory.expected(10.12).moved_on->pose().psi_rad, psi_1_rad + 0.2, 1e-9) << "a frame was dropped between";
  EXPECT_NEAR(memory.expected(10.08).moved_on->pose().psi_rad, psi_1_rad + 0.1, 1e-9);
}

TEST(InstrumentMemory, OfOneFrameKnowsNoStep) {
  const InstrumentMemory memory = remembered(std::nullopt, fit_at({0.1, 1.5, 0.06, psi_0_rad}), 10);
  EXPECT_EQ(memory.expected_pose(11).pose().psi_rad, psi_0_rad);
  EXPECT_FALSE(memory.expected(11).moved_on);
}

int looks_in(int frames, Processing answer, bool fully) {
  LookSchedule schedule;
  int looks = 0;
  for (int i = 0; i < frames; ++i) {
    const bool due = schedule.is_due();
    if (due) schedule.looked(answer, fully), ++looks;
    if (!due) schedule.passed();
  }
  return looks;
}

// In each frame of a camera that processes its images, now and then at one that does not.
TEST(LookSchedule, LooksAsOftenAsTheAnswerMayChange) {
  EXPECT_EQ(looks_in(100, Processing::found, true), 100);
  EXPECT_EQ(looks_in(160, Processing::none, false), 10);
  EXPECT_EQ(looks_in(100, Processing::unknown, false), 100) << "a quick look, until it answers";
}

TEST(LookSchedule, GoesOnInEachFrameAfterALookThatWasNotDue) {
  LookSchedule schedule;
  schedule.looked(Processing::none, false);
  schedule.looked(Processing::found, true);
  EXPECT_TRUE(schedule.is_due());
}

TEST(LookSchedule, RepeatsAFullLookWithoutAnAnswerAfterTwiceAsLong) {
  for (const auto& [frames, looks] : {std::pair(1, 1), {3, 2}, {6, 3}})
    EXPECT_EQ(looks_in(frames, Processing::unknown, true), looks);
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

}  // namespace lapservo::internal::instrument_memory_test
