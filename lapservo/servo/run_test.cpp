#include "lapservo/servo/run.h"

#include <algorithm>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/random_start.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/control/trajectory_check.h"
#include "lapservo/servo/convergence.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/servo/replay.h"
#include "lapservo/servo/servo_log.h"
#include "lapservo/sim/simulator.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"

namespace lapservo {
namespace {

// The trajectory as the half-size camera sees it.
Trajectory small_trajectory() {
  Sinusoids f = paper_sinusoids();
  f.offset.tail<3>() /= 2;
  f.amplitude.tail<3>() /= 2;
  return sinusoids(f);
}

struct Case {
  std::uint64_t seed = 1;
  double latency_s = 0.08, duration_s = 8;
  std::optional<Interval> hidden, faulted;
  ControlMode mode = ControlMode::fused;
};

struct Record {
  ServoInput input;
  ServoDecision decision;
  InstrumentTruth truth;
};

struct PastRun {
  std::vector<Record> records;
  Convergence convergence;

  Eigen::Vector4d error(std::size_t i) const {
    return feature_error(records[i].truth.features.value(), records[i].input.desired.features);
  }
};

RunConfig config_of(const Rig& rig, const Case& c) {
  RunConfig config;
  config.rig = rig;
  config.controller.mode = c.mode;
  config.controller.window = image_window(rig.camera, 10);
  return config;
}

class Watcher : public RunObserver {
 public:
  Watcher(const Case& c, const Rig& rig, Simulator& simulator)
      : case_(c), true_model_(feature_model(rig)), simulator_(simulator) {}

  bool on_tick(const ControlTick& tick) override {
    const double time_s = tick.input.time_s;
    Arm& arm = simulator_.arm();
    if (case_.faulted && case_.faulted->contains(time_s) && !arm.faulted()) arm.fault();
    if (case_.faulted && time_s >= case_.faulted->end_s && arm.faulted()) arm.recover();
    done.records.push_back({tick.input, tick.decision, truth_at(true_model_, simulator_.true_q())});
    done.convergence.add(time_s, done.error(done.records.size() - 1));
    return true;
  }

  PastRun done;

 private:
  Case case_;
  FeatureModel true_model_;
  Simulator& simulator_;
};

PastRun run_case(const Case& c) {
  const Rig rig = testing::small_test_rig();
  const RunConfig config = config_of(rig, c);
  SimulatorConfig simulated;
  simulated.seed = c.seed;
  simulated.endoscope.latency_s = c.latency_s;
  Random random(c.seed);
  const Trajectory trajectory = small_trajectory();
  Simulator simulator(rig, simulated,
                      random_start(trajectory, c.duration_s, feature_model(rig), config.controller,
                                   simulated.arm.joint_offset, random, "trajectory"));
  if (c.hidden) simulator.cover_marker(*c.hidden);
  Watcher watcher(c, rig, simulator);
  run(simulator, simulator, simulator, config, trajectory, c.duration_s, watcher);
  return std::move(watcher.done);
}

void expect_within_limits(const PastRun& done, const ControllerConfig& config) {
  constexpr double slack = 1e-9;
  std::size_t sent = 0;
  for (std::size_t i = 1; i < done.records.size(); ++i) {
    const MotionState &before = done.records[i - 1].decision.control.setpoint,
                      &now = done.records[i].decision.control.setpoint;
    if (!done.records[i - 1].decision.send || !done.records[i].decision.send) continue;
    ++sent;
    const Eigen::Array4d step = (now.position - before.position).cwiseAbs(),
                         change = (now.velocity - before.velocity).cwiseAbs();
    EXPECT_TRUE((step <= config.limits.rate.array() * config.period_s + slack).all()) << i;
    EXPECT_TRUE((change <= config.limits.acceleration.array() * config.period_s + slack).all()) << i;
    EXPECT_TRUE((now.position.array() <= config.limits.upper.array() + slack).all()) << i;
    EXPECT_TRUE((now.position.array() >= config.limits.lower.array() - slack).all()) << i;
  }
  EXPECT_GT(2 * sent, done.records.size());
}

TEST(Run, FollowsThePapersTrajectoryFromARandomStart) {
  for (const std::uint64_t seed : {1, 2}) {
    SCOPED_TRACE(seed);
    const PastRun done = run_case({seed, 0.08, 8, {}, {}, ControlMode::fused});
    ASSERT_TRUE(done.convergence.reached_s());
    EXPECT_LE(*done.convergence.reached_s(), 5);
    Eigen::Vector4d squares = Eigen::Vector4d::Zero(), sum = squares;
    int count = 0;
    for (std::size_t i = 300; i < done.records.size(); ++i, ++count)
      squares += done.error(i).cwiseAbs2(), sum += done.error(i);
    const Eigen::Vector4d rms = (squares / count).cwiseSqrt(), mean = sum / count;
    EXPECT_LE(rms[0], 0.5e-3);
    EXPECT_LE(rms.tail<3>().maxCoeff(), 0.3);
    EXPECT_LE(std::abs(mean[0]), 0.5e-3 / 3);
    EXPECT_LE(mean.tail<3>().cwiseAbs().maxCoeff(), 0.1);
    EXPECT_NEAR(done.records.back().decision.control.delay_s, 0.08, 0.5 / 60);
    expect_within_limits(done, config_of(testing::small_test_rig(), {}).controller);
  }
}

TEST(Run, LatencyDoesNotShakeIt) {
  for (const double latency_s : {0.0, 0.15, 0.25}) {
    SCOPED_TRACE(latency_s);
    const PastRun done = run_case({3, latency_s, 7, {}, {}, ControlMode::fused});
    ASSERT_TRUE(done.convergence.reached_s());
    EXPECT_LE(done.convergence.rms_since().tail<3>().maxCoeff(), 0.4);
    EXPECT_NEAR(done.records.back().decision.control.delay_s, latency_s, 0.5 / 60);
  }
}

TEST(Run, HoldsWhileTheMarkerIsHiddenAndGoesOnWithoutAJump) {
  Case c;
  c.hidden = Interval{3, 5};
  const PastRun done = run_case(c);
  const ControllerConfig controller = config_of(testing::small_test_rig(), c).controller;
  for (const Record& record : done.records) {
    // The last good frame arrives 80 ms later; jitter and a lost frame may move it by a period or two.
    const double since_s = record.input.time_s - 3.08, before_s = record.input.time_s - 5.08;
    if (since_s > 2 * controller.period_s && before_s < -2 * controller.period_s) {
      EXPECT_EQ(record.decision.control.action, ControlAction::hold) << record.input.time_s;
      EXPECT_EQ(record.decision.control.reason, HoldReason::marker_lost) << record.input.time_s;
    }
    if (before_s > 3 * controller.period_s) {
      EXPECT_EQ(record.decision.control.action, ControlAction::track) << record.input.time_s;
    }
  }
  expect_within_limits(done, controller);
  EXPECT_LT(done.error(done.records.size() - 1).tail<3>().cwiseAbs().maxCoeff(), 1);
}

TEST(Run, SurvivesAnArmFault) {
  Case c;
  c.faulted = Interval{3, 4};
  const PastRun done = run_case(c);
  const auto is_fault = [](const Record& record) {
    return record.decision.control.reason == HoldReason::arm_not_enabled;
  };
  EXPECT_NEAR(static_cast<double>(std::count_if(done.records.begin(), done.records.end(), is_fault)), 60, 3);
  expect_within_limits(done, config_of(testing::small_test_rig(), c).controller);
  EXPECT_LT(done.error(done.records.size() - 1).tail<3>().cwiseAbs().maxCoeff(), 1);
}

// The same seed gives the same run, and the log is enough to decide everything again.
TEST(Run, RepeatsAndReplaysBitForBit) {
  const testing::TemporaryFolder folder;
  for (const ControlMode mode : {ControlMode::fused, ControlMode::paper}) {
    Case c;
    c.seed = 4;
    c.duration_s = 2;
    c.mode = mode;
    const PastRun first = run_case(c), second = run_case(c);
    ServoLog log(folder / "log.csv");
    for (const Record& record : first.records) log.add(record.input, record.decision, record.truth);
    log.commit();
    ASSERT_EQ(first.records.size(), second.records.size());
    for (std::size_t i = 0; i < first.records.size(); ++i)
      ASSERT_EQ(decision_fields(first.records[i].decision), decision_fields(second.records[i].decision)) << i;
    auto ticks = read_servo_log(folder / "log.csv");
    const RunConfig config = config_of(testing::small_test_rig(), c);
    EXPECT_FALSE(replay(ticks, config.rig, config.controller));
    ticks[70].input.desired.features[1] += 1e-9;
    EXPECT_TRUE(replay(ticks, config.rig, config.controller));
  }
}

TEST(Run, RefusesWhatCanNotBeFollowedNamingTimeAndLimit) {
  const Rig rig = testing::paper_test_rig();
  ControllerConfig controller;
  controller.window = image_window(rig.camera, 20);
  Sinusoids fast = paper_sinusoids();
  fast.omega_rad_s.setConstant(12);
  const JointVector start{0.05, 1.57, 0.064, 1.2};
  const std::string complaint = testing::input_error(
      [&] { refuse_infeasible(sinusoids(fast), 10, feature_model(rig), controller, start, "fast.csv"); });
  EXPECT_NE(complaint.find("fast.csv"), std::string::npos) << complaint;
  EXPECT_NE(complaint.find(" s: limits.rate"), std::string::npos) << complaint;
  EXPECT_EQ(testing::input_error([&] {
              refuse_infeasible(sinusoids(paper_sinusoids()), 20, feature_model(rig), controller, start, "");
            }),
            "");
}

}  // namespace
}  // namespace lapservo
