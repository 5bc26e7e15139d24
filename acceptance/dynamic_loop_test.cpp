#include "acceptance/dynamic_loop.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace lapservo::testing {
namespace {

const Trajectory papers = sinusoids(paper_sinusoids());
constexpr double delay_s = 0.08;

bool holds(const DynamicTick& tick) {
  return tick.decision.control.action == ControlAction::hold;
}

double worst_delay_error_s(const std::vector<DynamicTick>& ticks, double from_s) {
  double worst_s = 0;
  for (const DynamicTick& tick : ticks)
    if (tick.time_s >= from_s) worst_s = std::max(worst_s, std::abs(tick.decision.control.delay_s - delay_s));
  return worst_s;
}

TEST(DynamicLoop, CrossesFrictionAtReversals) {
  DynamicLoop sticking, smooth;
  smooth.arm_config.friction.setZero();
  for (DynamicLoop* loop : {&sticking, &smooth}) {
    const Eigen::Vector4d rms = rms_from(loop->run(papers, 20), 5);
    EXPECT_LE(rms[0], 0.3e-3);
    EXPECT_LE(rms[1], 0.15);  // r: without crossing friction 0.50
    EXPECT_LE(rms.tail<2>().maxCoeff(), 0.2);
  }
}

// However long; before it has ever moved, before it has gone both ways, at speed and when it has settled.
TEST(DynamicLoop, IsNotFastWhenABlockedJointIsReleased) {
  for (int joint = 0; joint < 4; ++joint) {
    for (const double begin_s : {0.0, 0.3, 1.3, 4.0}) {
      for (const double duration_s : {0.2, 0.7, 3.0}) {
        SCOPED_TRACE(::testing::Message() << joint << " blocked from " << begin_s << " for " << duration_s);
        DynamicLoop loop;
        bool blocked = false;
        loop.meddle = [&](double time_s, MujocoArm& arm) {
          const bool wanted = time_s >= begin_s && time_s < begin_s + duration_s;
          if (wanted == blocked) return;
          wanted ? arm.block(joint) : arm.release(joint);
          blocked = wanted;
        };
        const auto ticks = loop.run(papers, begin_s + duration_s + 4);
        Eigen::Vector4d fastest = Eigen::Vector4d::Zero();
        for (const DynamicTick& tick : ticks) fastest = fastest.cwiseMax(tick.fastest);
        EXPECT_LE(fastest.cwiseQuotient(loop.controller.limits.rate).maxCoeff(), 1.2);
        EXPECT_LT(ticks.back().error.tail<3>().cwiseAbs().maxCoeff(), 1);
      }
    }
  }
}

// At any time of the trajectory: where its joints are fast, and where they turn and stand still on their friction.
TEST(DynamicLoop, HoldsWithin100MsOfAPictureThatFreezes) {
  for (int k = 0; k < 20; ++k) {
    DynamicLoop loop;
    const double begin_s = 6 + 0.37 * k, end_s = begin_s + 1;
    loop.frozen = Interval{begin_s, end_s};
    const auto ticks = loop.run(papers, end_s + 3);
    for (const DynamicTick& tick : ticks) {
      if (tick.time_s > begin_s + 0.1 && tick.time_s < end_s - 1e-9) {
        EXPECT_EQ(tick.decision.control.reason, HoldReason::frozen_image) << begin_s << ' ' << tick.time_s;
      }
    }
    EXPECT_LT(ticks.back().error.tail<3>().cwiseAbs().maxCoeff(), 1);
  }
}

TEST(DynamicLoop, SaysThatAJointDoesNotFollow) {
  DynamicLoop loop;
  loop.meddle = [](double time_s, MujocoArm& arm) {
    if (std::abs(time_s - 4) < 1e-3) arm.block(2);
  };
  const auto ticks = loop.run(papers, 8);
  EXPECT_TRUE(std::any_of(ticks.begin(), ticks.end(), [](const DynamicTick& tick) {
    return tick.time_s > 4 && tick.decision.control.reason == HoldReason::not_following;
  }));
}

// Holds until an image gives the instrument's place; the rest is the desired motion of that time.
TEST(DynamicLoop, AnEncoderThatIsSetIsFoundOut) {
  for (int joint = 0; joint < 4; ++joint) {
    for (const double by : {0.01, 0.03}) {
      SCOPED_TRACE(::testing::Message() << joint << " by " << by);
      DynamicLoop loop;
      loop.misread = [&](double time_s) -> Eigen::Vector4d {
        const Eigen::Vector4d size(1, 1, 0.1, 4);
        return (time_s >= 6 ? by : 0) * size[joint] * Eigen::Vector4d::Unit(joint);
      };
      const auto ticks = loop.run(papers, 10);
      EXPECT_LE(worst_delay_error_s(ticks, 5), 0.005);
      for (const DynamicTick& tick : ticks) {
        if (tick.time_s < 6) continue;
        EXPECT_LE(tick.error.tail<3>().cwiseAbs().maxCoeff(), 8) << tick.time_s;
      }
      EXPECT_FALSE(holds(ticks.back()));
      EXPECT_LT(ticks.back().error.tail<3>().cwiseAbs().maxCoeff(), 1);
    }
  }
}

// The first guess is 100 ms.
TEST(DynamicLoop, DoesNotOvershootWhileTheDelayIsUnknown) {
  for (const double latency_s : {0.0, 0.1, 0.2}) {
    SCOPED_TRACE(latency_s);
    DynamicLoop loop;
    loop.latency_s = latency_s;
    const auto ticks = loop.run(set_point(paper_sinusoids().offset), 6);
    const Eigen::Vector4d first = ticks.front().error;
    for (const DynamicTick& tick : ticks) {
      EXPECT_GE(tick.error[0] * std::copysign(1, first[0]), -1e-3) << tick.time_s;
      EXPECT_GE(tick.error[1] * std::copysign(1, first[1]), -1) << tick.time_s;
    }
    EXPECT_LE(rms_from(ticks, 5).tail<3>().maxCoeff(), 1);
  }
}

// Its servos are a quarter as stiff: it hangs below its setpoints by more than the following-error limit.
TEST(DynamicLoop, AnArmThatHangsLowIsNotTakenForBlocked) {
  DynamicLoop loop;
  loop.arm_config.proportional_gain[2] /= 4;
  loop.arm_config.derivative_gain[2] /= 2;
  loop.arm_config.friction[2] /= 4;
  const auto ticks = loop.run(papers, 10);
  EXPECT_LE(rms_from(ticks, 6).tail<3>().maxCoeff(), 1);
}

}  // namespace
}  // namespace lapservo::testing
