#include "lapservo/servo/run_summary.h"

#include <gtest/gtest.h>

namespace lapservo::internal::run_summary_test {

constexpr double period_s = 0.1;

class RunSummaryTest : public ::testing::Test {
 protected:
  void add(ControlAction action, HoldReason reason, int count, const std::string& block = {}) {
    ControlTick tick;
    tick.decision.control.action = action, tick.decision.control.reason = reason;
    tick.decision.registration_contradicted = contradicted;
    if ((tick.pursues_tip = tip_error_px.has_value())) tick.decision.control.estimate.emplace();
    tick.tip_error_px = tip_error_px, tick.decision.camera_from_rcm = camera_from_rcm;
    InstrumentTruth truth;
    truth.features = feature_error_rad * Eigen::Vector4d::UnitX();
    for (int i = 0; i < count; ++i, time_s += period_s) tick.input.time_s = time_s, summary.add(tick, truth, block);
  }
  bool says(const std::string& part) const { return summary.text().find(part) != std::string::npos; }

  RunSummary summary;
  double time_s = 0, feature_error_rad = 0;
  bool contradicted = false;
  std::optional<Eigen::Vector2d> tip_error_px;
  std::optional<Rigid3> camera_from_rcm;
};

TEST_F(RunSummaryTest, CountsHoldsByTheirReasonOrTheArms) {
  add(ControlAction::hold, HoldReason::arm_not_enabled, 2, "not_homed");
  add(ControlAction::hold, HoldReason::marker_lost, 3);
  add(ControlAction::track, HoldReason::none, 15);
  EXPECT_TRUE(says("held for 2 of 20 ticks: not_homed")) << summary.text();
  EXPECT_TRUE(says("held for 3 of 20 ticks: marker_lost")) << summary.text();
  EXPECT_TRUE(summary.succeeded(true));
  add(ControlAction::hold, HoldReason::marker_lost, 1);
  EXPECT_TRUE(says("ended in a hold: marker_lost")) << summary.text();
  EXPECT_FALSE(summary.succeeded(false));
  feature_error_rad = 0.5;
  add(ControlAction::track, HoldReason::none, 1);
  EXPECT_TRUE(says("not within 1 px and 5 mrad for the last second, though from 0.00 s on for a second"));
  EXPECT_FALSE(summary.succeeded(false));
}

// A marker that is hidden for long is no error of what was tracked.
TEST_F(RunSummaryTest, ErrorsOfHoldsAreNoPartOfTheRms) {
  add(ControlAction::track, HoldReason::none, 15);
  EXPECT_TRUE(says("rms since: s 0.00 mrad") && !says("by the loop's own estimate")) << summary.text();
  feature_error_rad = 0.5;
  add(ControlAction::hold, HoldReason::marker_lost, 30);
  feature_error_rad = 0;
  add(ControlAction::track, HoldReason::none, 5);
  EXPECT_TRUE(says("rms since while it tracked (held for 30 ticks): s 0.00 mrad")) << summary.text();
}

// Images of before the endoscope moved are no part of it. The true features differ from those that a wrong
// registration has for the tip's place.
TEST_F(RunSummaryTest, AGoalOfTheTipIsReachedByTheLoopsOwnError) {
  feature_error_rad = 0.5;
  camera_from_rcm.emplace();
  tip_error_px = Eigen::Vector2d(30, 40);
  add(ControlAction::track, HoldReason::none, 15);
  camera_from_rcm.reset();
  add(ControlAction::hold, HoldReason::endoscope_moved, 1);
  tip_error_px = Eigen::Vector2d(0.3, 0.4);
  add(ControlAction::track, HoldReason::none, 15);
  EXPECT_TRUE(says("s 0.00 mrad")) << summary.text();
  EXPECT_TRUE(says("px, by the loop's own estimate; the seen tip 0.50 px from its goal")) << summary.text();
}

TEST_F(RunSummaryTest, AContradictedRegistrationIsNoSuccessWhenStrict) {
  contradicted = true;
  add(ControlAction::track, HoldReason::none, 15);
  EXPECT_TRUE(summary.succeeded(false));
  EXPECT_FALSE(summary.succeeded(true));
  EXPECT_TRUE(says("registration_contradicted in 15 of 15 ticks")) << summary.text();
}

}  // namespace lapservo::internal::run_summary_test
