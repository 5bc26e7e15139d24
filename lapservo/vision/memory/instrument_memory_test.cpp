#include "lapservo/vision/memory/instrument_memory.h"

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

FineFit fit_at(const JointVector& q) {
  FineFit fit;
  fit.unknowns = PoseUnknowns::rcm({}, q);
  return fit;
}

constexpr double psi_0_rad = 0.3, psi_1_rad = 0.4;

// Found in two frames that were taken 40 ms apart.
InstrumentMemory moving() {
  const InstrumentMemory first = remembered(std::nullopt, fit_at({0.1, 1.5, 0.06, psi_0_rad}), false, 10);
  return remembered(first, fit_at({0.1, 1.5, 0.065, psi_1_rad}), false, 10.04);
}

TEST(InstrumentMemory, ExpectsAnInstrumentToMoveOn) {
  const InstrumentMemory memory = moving();
  for (const double frames : {0.5, 1.0, 3.0}) {
    const PoseUnknowns expected = memory.expected_pose(10.04 + frames * 0.04);
    EXPECT_NEAR(expected.q()->psi_rad, psi_1_rad + frames * 0.1, 1e-9);
    EXPECT_NEAR(expected.q()->rho_m, 0.065 + frames * 0.005, 1e-9);
  }
  EXPECT_LT(memory.expected_pose(1e6).q()->psi_rad, psi_1_rad + 0.5);
  EXPECT_EQ(memory.expected_pose(9).q()->psi_rad, psi_1_rad);
}

TEST(InstrumentMemory, ComparesATurnWithWhatTheTimeAllows) {
  const InstrumentMemory memory = moving();
  const PoseUnknowns evenly_on = fit_at({0.1, 1.5, 0.07, psi_1_rad + 0.2}).unknowns;
  EXPECT_NEAR(memory.turn_change_rad(evenly_on, 10.12).value(), 0, 1e-9) << "a frame was dropped between";
  EXPECT_NEAR(memory.turn_change_rad(evenly_on, 10.08).value(), 0.1, 1e-9);
}

TEST(InstrumentMemory, OfOneFrameKnowsNoStep) {
  const InstrumentMemory memory = remembered(std::nullopt, fit_at({0.1, 1.5, 0.06, psi_0_rad}), true, 10);
  EXPECT_EQ(memory.expected_pose(11).q()->psi_rad, psi_0_rad);
  EXPECT_FALSE(memory.turn_change_rad(memory.last, 11));
  EXPECT_TRUE(memory.among_others);
}

}  // namespace
}  // namespace lapservo::internal
