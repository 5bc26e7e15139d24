#include "lapservo/crtk/interlock.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/control/motion_limits.h"
#include "lapservo/core/random.h"
#include "lapservo/crtk/joint_map.h"

namespace lapservo::internal::interlock_test {

constexpr double epoch_s = 1.7e9, tick_s = 0.002, joints_period_s = 0.004;
const double max_s = InterlockConfig().max_age_s;

Joints psm() {
  return {{"yaw", "pitch", "insertion", "roll"}, {1, -1, 1, 1}, {0, 1.5707963, -0.0156, 0}};
}

InterlockConfig config_of(bool motion_enabled = true, const std::vector<std::string>& wrist = {}) {
  InterlockConfig config;
  config.joints = psm();
  config.wrist = wrist;
  config.motion_enabled = motion_enabled;
  return config;
}

// An arm that obeys after `lag_s`, whose setpoint lies beside its joints (gravity), on a clock that only this test
// moves.
class Bench {
 public:
  explicit Bench(const InterlockConfig& config = config_of()) : interlock(config), config_(config) { enable(); }

  void enable(const std::string& state = "ENABLED", bool homed = true, bool busy = false) {
    interlock.on_operating_state({epoch_s + now_s, state, homed, busy}, now_s);
  }
  JointMessage message(const Eigen::Vector4d& of_q) const {
    const Eigen::Vector4d joints = joints_from_q(psm(), of_q);
    return {epoch_s + now_s,
            {"yaw", "pitch", "wrist", "insertion", "roll"},
            {joints[0], joints[1], wrist, joints[2], joints[3]}};
  }
  // An arm's word of the other process `source`, on its state's (0), its setpoints' (1) or its joints' (2) topic.
  void hear(int topic, std::uint64_t source, const Eigen::Vector4d& of_q) {
    JointMessage joints = message(of_q);
    joints.source = source;
    if (topic == 0) interlock.on_operating_state({epoch_s, "ENABLED", true, false, source}, now_s);
    if (topic == 1) interlock.on_setpoint(joints, now_s);
    if (topic == 2) interlock.on_measured(joints, now_s);
  }
  Eigen::Vector4d followed() const {
    const Eigen::Vector4d q = on_their_way_.empty() ? setpoint : on_their_way_.front().second;
    const Eigen::Array4d unit = rounding_rad * Eigen::Array4d(1, 1, 0.1, 2);
    return rounding_rad > 0 ? Eigen::Vector4d((q.array() / unit).round() * unit) : q;
  }
  // Time passes; the arm speaks and the interlock ticks. `alter` may change what the arm says, or drop it (false).
  void pass(double duration_s) {
    for (const double end_s = now_s + duration_s; now_s < end_s - 1e-9; now_s += tick_s) {
      while (on_their_way_.size() > 1 && on_their_way_[1].first <= now_s + 1e-9) on_their_way_.pop_front();
      if (now_s >= next_joints_s_) {
        next_joints_s_ = now_s + joints_period_s;
        if (talking) {
          interlock.on_setpoint(message(followed()), now_s);
          JointMessage measured = message(followed() + sag);
          if (alter) alter(measured);
          interlock.on_measured(measured, now_s);
        }
      }
      const auto sent = now_s < stalled_until_s ? std::nullopt : interlock.tick(now_s);
      if (!sent && now_s >= stalled_until_s) rate_.setZero();  // it rests
      if (!sent) continue;
      EXPECT_EQ(sent->size(), 5u);
      EXPECT_NEAR(sent->at(2), wrist, wrist_behind);
      if (losing) continue;  // on its way to the arm
      const Eigen::Vector4d q = q_from_joints(psm(), {sent->at(0), sent->at(1), sent->at(3), sent->at(4)});
      const Eigen::Array4d step = (q - setpoint).array().abs();
      EXPECT_TRUE((step <= config_.limits.rate.array() * tick_s + 1e-12).all()) << step.transpose();
      expect_velocities(q - setpoint);
      const Eigen::Array4d rate = (q - setpoint).array() / tick_s;
      EXPECT_TRUE(((rate - rate_).abs() <= 1.001 * config_.limits.acceleration.array() * tick_s + 1e-9).all())
          << "at " << now_s << ": " << (rate - rate_).transpose();
      rate_ = rate;
      setpoint = q;
      if (lag_s > 0) on_their_way_.emplace_back(now_s + lag_s, q);
      last_sent_s = now_s;
      last_wrist = sent->at(2);
      ++sent_count;
    }
  }
  // Like the loop once a period: restarts where the arm is after a report that it is not ready.
  void control(double duration_s, const Eigen::Vector4d& velocity) {
    constexpr double period_s = 1.0 / 60;
    for (const double end_s = now_s + duration_s; now_s < end_s - 1e-9;) {
      const JointState state = interlock.state(now_s);
      blocked = state.blocked;
      if (blocked != Blocked::none) {
        path.reset(now_s, state.q.vector());
      } else {
        path.ramp_to(now_s, velocity, period_s);
        interlock.follow(path);
      }
      pass(period_s);
    }
  }

  Interlock interlock;
  JointPath path{JointLimits().acceleration};
  Eigen::Vector4d setpoint{0.1, 1.5, 0.08, 0.5}, sag{0.004, -0.003, 0.001, 0.02};
  double now_s = 10, stalled_until_s = 0, lag_s = 0, rounding_rad = 0, wrist = 0.3, wrist_behind = 0, last_wrist = 0,
         last_sent_s = 0;
  int sent_count = 0;
  Blocked blocked = Blocked::none;
  bool talking = true;
  bool losing = false;  // of what is sent
  std::function<void(JointMessage&)> alter;

 private:
  // Compares the velocities of all joints with the step, or with zero at the end of a motion.
  void expect_velocities(const Eigen::Vector4d& step) const {
    const auto sent = interlock.velocities();
    ASSERT_EQ(sent.size(), 5u);
    EXPECT_EQ(sent[2], 0);
    const Eigen::Vector4d rate =
        q_from_joints(psm(), {sent[0], sent[1], sent[3], sent[4]}) - q_from_joints(psm(), Eigen::Vector4d::Zero());
    EXPECT_TRUE(rate.isApprox(step / tick_s, 1e-6) || (rate.isZero() && step.cwiseAbs().maxCoeff() < 1e-4)) << rate;
  }

  InterlockConfig config_;
  double next_joints_s_ = 0;
  Eigen::Array4d rate_ = Eigen::Array4d::Zero();                 // of the last setpoint sent
  std::deque<std::pair<double, Eigen::Vector4d>> on_their_way_;  // setpoints, with when they arrive
};

const Eigen::Vector4d slow(0.1, -0.1, 0.01, 0.3), fast(9, 9, 9, 9);

// The newest thousand where nobody takes them.
TEST(Interlock, TellsEveryReadingOnce) {
  Bench bench;
  bench.pass(0.1);
  bench.interlock.take_readings();
  for (const double passed_s : {0.1, 1100 * joints_period_s}) {
    bench.pass(passed_s);
    EXPECT_FALSE(bench.interlock.latest_readings().empty());  // takes none
    const auto readings = bench.interlock.take_readings();
    const double arrived = passed_s / joints_period_s;
    ASSERT_NEAR(static_cast<double>(readings.size()), std::min(arrived, 1000.0), arrived < 1000 ? 1 : 0);
    for (std::size_t i = 1; i < readings.size(); ++i)
      EXPECT_NEAR(readings[i].time_s - readings[i - 1].time_s, joints_period_s, 1e-6);
    EXPECT_NEAR(readings.back().time_s, bench.now_s - joints_period_s, joints_period_s);
    EXPECT_TRUE(bench.interlock.take_readings().empty());
  }
}

TEST(Interlock, FollowsFromTheArmsOwnSetPointOn) {
  Bench bench;
  bench.control(0.05, Eigen::Vector4d::Zero());
  const Eigen::Vector4d start = bench.setpoint;
  EXPECT_TRUE(start.isApprox(Bench().setpoint, 1e-12));  // not moved to where the arm sags
  bench.control(1, slow);
  EXPECT_GT(bench.sent_count, 450);
  EXPECT_TRUE((bench.setpoint - start).isApprox(slow, 0.1));
  EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
}

// Somebody else moves it, through the arm's own setpoint; neither ends the motion of the four.
TEST(Interlock, TheWristPassesThrough) {
  Bench bench(config_of(true, {"outer_wrist"}));  // by the name before dVRK 2.3
  bench.control(0.2, slow);
  bench.wrist_behind = 1e-2;  // until the arm says so
  double fastest_rad = 0;
  for (int k = 0; k < 60; ++k) {
    bench.wrist += 0.5 / 60;
    bench.control(1.0 / 60, slow);
    EXPECT_EQ(bench.blocked, Blocked::none) << k;
    fastest_rad = std::max(fastest_rad, std::abs(bench.last_wrist - bench.wrist));
  }
  EXPECT_EQ(fastest_rad, 0);  // once it moves it follows at once
  EXPECT_GT(bench.sent_count, 500);
  bench.talking = false;  // it moves on while the arm is silent
  bench.control(0.3, slow);
  bench.talking = true;
  bench.wrist += 0.4;
  const int sent = bench.sent_count;
  bench.control(0.5, slow);
  EXPECT_GT(bench.sent_count, sent + 200);
  EXPECT_EQ(bench.last_wrist, bench.wrist);
}

// Sent back, the arm's rounding would add up.
TEST(Interlock, AWristThatTheArmRoundsStaysWhereItWas) {
  Bench bench(config_of(true, {"wrist"}));
  bench.control(0.2, slow);
  const double before = bench.wrist;
  bench.wrist_behind = 3.1e-3;
  bench.wrist += 3e-3;
  bench.control(1, slow);
  EXPECT_EQ(bench.last_wrist, before);
}

TEST(Interlock, NoStepExceedsTheRateLimitWhateverThePathDoes) {
  Bench bench;  // pass() checks every step
  bench.control(0.1, slow);
  bench.control(0.5, fast);
  EXPECT_GT(bench.sent_count, 200);
  JointPath jump(JointLimits().acceleration);
  jump.reset(bench.now_s, bench.setpoint + Eigen::Vector4d::Ones());
  bench.interlock.follow(jump);
  bench.pass(0.2);
}

TEST(Interlock, StaysWithinTheLimitsAndComesBackFromBeyond) {
  InterlockConfig config = config_of();
  config.limits.upper = Eigen::Vector4d(0.15, 2.5, 0.2, 4);
  Bench bench(config);
  bench.control(2, {0.2, 0, 0, 0});
  EXPECT_NEAR(bench.setpoint[0], 0.15, 1e-9);
  Bench beyond(config);
  beyond.setpoint[0] = 0.3;
  beyond.control(0.5, {0.2, 0, 0, 0});
  EXPECT_NEAR(beyond.setpoint[0], 0.3, 1e-9);
  beyond.control(1, {-0.2, 0, 0, 0});  // half of it brings the path back
  EXPECT_LT(beyond.setpoint[0], 0.25);
}

// Another joint that needs longer to stop takes none beyond its limit.
TEST(Interlock, BrakesWithinTheLimits) {
  for (const double before_s : {0.0, 0.03, 0.06, 0.1}) {
    InterlockConfig config = config_of();
    config.limits.upper = Eigen::Vector4d(0.15, 2.5, 0.2, 4);
    Bench bench(config);
    bench.setpoint[0] = 0.05;
    bench.control(0.5 - before_s, {0.2, 0, 0, config.limits.rate[3]});
    bench.talking = false;
    bench.control(0.5, slow);
    EXPECT_LE(bench.setpoint[0], 0.15) << before_s;
  }
}

struct Fault {
  const char* name;
  Blocked blocked;
  double within_s;  // 0: the arm does not listen
  std::function<void(Bench&)> begin;
};

std::vector<Fault> faults() {
  const auto alter = [](std::function<void(JointMessage&)> how) { return [how](Bench& bench) { bench.alter = how; }; };
  const double stamp_s = epoch_s + 10.3;
  return {
      {"silence", Blocked::old_joint_states, max_s, [](Bench& b) { b.talking = false; }},
      {"NaN", Blocked::non_finite_joints, joints_period_s,
       alter([](JointMessage& m) { m.positions[0] = std::nan(""); })},
      {"infinite wrist", Blocked::non_finite_joints, joints_period_s,
       alter([](JointMessage& m) { m.positions[2] = INFINITY; })},
      {"stamps stand still", Blocked::old_joint_states, max_s, alter([=](JointMessage& m) { m.stamp_s = stamp_s; })},
      {"no stamps", Blocked::old_joint_states, max_s, alter([](JointMessage& m) { m.stamp_s = 0; })},
      {"stamps are none", Blocked::old_joint_states, max_s, alter([](JointMessage& m) { m.stamp_s = std::nan(""); })},
      {"a position is missing", Blocked::old_joint_states, max_s,
       alter([](JointMessage& m) { m.positions.pop_back(); })},
      {"a name is missing", Blocked::old_joint_states, max_s, alter([](JointMessage& m) { m.names[0] = "elbow"; })},
      {"too many joints", Blocked::old_joint_states, max_s,
       alter([](JointMessage& m) { m.names.resize(100000, "x"), m.positions.resize(100000); })},
      {"late", Blocked::old_joint_states, max_s,
       alter([=](JointMessage& m) { m.stamp_s = std::max(stamp_s, m.stamp_s - 0.2); })},
      {"PAUSED", Blocked::not_enabled, 0, [](Bench& b) { b.enable("PAUSED"); }},
      {"FAULT", Blocked::not_enabled, 0, [](Bench& b) { b.enable("FAULT"); }},
      {"a word", Blocked::not_enabled, 0, [](Bench& b) { b.enable("enabled?"); }},
      {"not homed", Blocked::not_homed, 0, [](Bench& b) { b.enable("ENABLED", false); }},
      {"busy", Blocked::busy, 0, [](Bench& b) { b.enable("ENABLED", true, true); }},
  };
}

// Each: no setpoint leaves later than `within_s` after it, but those that brake an arm which still listens, and motion
// goes on afterwards without a jump.
TEST(Interlock, HoldsAtEveryFaultAndGoesOnAfterwards) {
  for (const Fault& fault : faults()) {
    SCOPED_TRACE(fault.name);
    Bench bench;
    bench.control(0.3, slow);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
    const double fault_s = bench.now_s;
    fault.begin(bench);
    bench.control(1, slow);
    EXPECT_EQ(bench.blocked, fault.blocked) << to_string(bench.blocked);
    const double braking_s = fault.within_s > 0 ? stopping_time_s(JointLimits()) : 0;
    EXPECT_LE(bench.last_sent_s, fault_s + fault.within_s + braking_s + 2 * tick_s);
    const int sent = bench.sent_count;
    bench.alter = nullptr, bench.talking = true, bench.enable();
    bench.setpoint += Eigen::Vector4d(0.02, 0, 0, 0.1);  // moved meanwhile: the steps from there on count
    bench.control(1.1, slow);                            // until it has rested for long enough
    EXPECT_GT(bench.sent_count, sent + 150);
  }
}

TEST(Interlock, AStateThatNobodyKnowsIsToldAsItIs) {
  Bench bench;
  bench.enable("READY\n");
  const JointState state = bench.interlock.state(bench.now_s);
  EXPECT_EQ(state.operating_state, OperatingState::disabled);
  EXPECT_EQ(state.other_state, "READY?");
}

// It says so a moment before or after the fault; of before, of another program and of a connection before they are not.
TEST(Interlock, AFaultIsToldInTheArmsOwnWords) {
  const auto told = [](const TextMessage& error, double before_s, const std::string& state = "FAULT") {
    Bench bench;
    bench.interlock.on_error(error, bench.now_s);
    bench.control(0.3 + before_s, slow);
    EXPECT_EQ(bench.blocked, Blocked::none) << "words alone change nothing";
    EXPECT_GT(bench.sent_count, 100);
    bench.enable(state);
    return bench.interlock.latest(bench.now_s).other_state;
  };
  const TextMessage words{"PSM1: power\nloss " + std::string(200, '!')};
  const std::string its_own = "FAULT (PSM1: power?loss " + std::string(103, '!') + ")";
  EXPECT_EQ(told(words, 0.6), its_own);
  EXPECT_EQ(told(words, 0.8), "");
  EXPECT_EQ(told(words, 0, "PAUSED"), "");
  EXPECT_EQ(told({"x", 7}, 0), "");
  EXPECT_EQ(told({"x", 0, Latched::again}, 0), "");
  Interlock interlock(config_of());
  const auto told_in = [&](const char* state, double time_s) {
    interlock.on_operating_state({epoch_s, state}, time_s);
    interlock.on_operating_state({epoch_s, state}, time_s);
    return interlock.latest(time_s).other_state;
  };
  interlock.on_error(words, 10);
  EXPECT_EQ(told_in("FAULT", 10), "") << "when the words were said is not known";
  EXPECT_EQ(told_in("ENABLED", 12), "");
  EXPECT_EQ(told_in("FAULT", 12), "");
  interlock.on_error(words, 12.1);
  EXPECT_EQ(told_in("FAULT", 20), its_own);
}

// A fault of no time at all, between two ticks: what was sent before is not taken up as if nothing had happened.
TEST(Interlock, TellsOfAFaultHoweverShort) {
  for (const Fault& fault : faults()) {
    if (fault.within_s > 0) continue;
    Bench bench;
    bench.control(0.3, slow);
    fault.begin(bench);
    bench.enable();
    const int sent = bench.sent_count;
    bench.interlock.follow(bench.path);
    bench.pass(0.01);
    EXPECT_EQ(bench.sent_count, sent);
    EXPECT_EQ(bench.interlock.latest(bench.now_s).blocked, Blocked::none);  // takes nothing from the loop
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, fault.blocked);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
  }
}

TEST(Interlock, NothingIsSentWhileSomebodyElseCommandsTheArm) {
  for (const int joint : {-1, 0, 2}) {  // whose setpoint the arm says that it follows; -1: the command itself is heard
    Bench bench;
    bench.control(0.3, slow);
    JointMessage foreign = bench.message(bench.setpoint);
    foreign.stamp_s += 1e-4;
    if (joint >= 0) foreign.positions.at(static_cast<std::size_t>(joint)) += 0.02;
    joint < 0 ? bench.interlock.on_foreign_command(bench.now_s) : bench.interlock.on_setpoint(foreign, bench.now_s);
    const int sent = bench.sent_count;
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::foreign_command);
    bench.control(max_s / 2, slow);
    EXPECT_EQ(bench.sent_count, sent);
    bench.control(0.2, slow);
    EXPECT_EQ(bench.blocked, Blocked::none);
  }
}

TEST(Interlock, ASetPointOfTheLastSecondIsOursAndAnOlderOneIsNot) {
  for (const double lag_s : {0.05, 0.3, 0.9, 1.3}) {
    Bench bench;
    bench.lag_s = lag_s;
    bench.control(0.1, slow);
    for (int k = 0; k < 120 && bench.blocked == Blocked::none; ++k) bench.control(1.0 / 60, slow);
    EXPECT_EQ(bench.blocked, lag_s < 1 ? Blocked::none : Blocked::foreign_command);
  }
}

// Teleoperation that begins where the arm is: its commands alternate with ours.
TEST(Interlock, AnArmThatGoesBackOnItsPathObeysSomebodyElse) {
  for (const double lag_s : {0.0, 0.1})
    for (const double ago_s : {0.01, 0.05, 0.3, 0.9}) {
      Bench bench;
      bench.lag_s = lag_s;
      bench.control(0.5, slow);
      JointMessage earlier = bench.message(bench.followed());
      bench.control(ago_s, slow);
      EXPECT_EQ(bench.blocked, Blocked::none);
      earlier.stamp_s = epoch_s + bench.now_s - 1e-4;
      bench.interlock.on_setpoint(earlier, bench.now_s);
      EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::foreign_command);
    }
}

// Beside the setpoints of the last second, not merely among them: a teleoperated arm at a place that we have passed.
TEST(Interlock, AnArmBesideItsPathObeysSomebodyElse) {
  Bench bench;
  bench.control(0.2, {0.3, 0, 0, 0});
  bench.control(0.4, {0, 0.3, 0, 0});
  JointMessage beside = bench.message(bench.setpoint - Eigen::Vector4d(0.03, 0.05, 0, 0));
  beside.stamp_s -= 1e-4;
  bench.interlock.on_setpoint(beside, bench.now_s);
  EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::foreign_command);
}

// An arm that falls silent and goes on, or stands still meanwhile and then works off what was sent: braked, and no
// word of another program.
TEST(Interlock, APauseOfTheArmIsBrakedAndNobodysCommand) {
  for (const double pause_s : {0.05, 0.1, 0.3, 0.45})
    for (const double lag_s : {0.0, 0.1}) {
      Bench bench;  // pass() checks every step
      bench.lag_s = lag_s;
      std::set<Blocked> reasons;
      bench.control(0.3, slow);
      for (int k = 0; k < 10; ++k) {
        bench.talking = false;
        bench.control(pause_s, slow);
        bench.talking = true;
        for (int tick = 0; tick < 60; ++tick) {
          bench.control(1.0 / 60, k % 2 ? slow : Eigen::Vector4d(-slow));
          reasons.insert(bench.blocked);
        }
      }
      reasons.erase(Blocked::old_joint_states), reasons.erase(Blocked::no_setpoint);
      EXPECT_EQ(reasons, std::set{Blocked::none}) << pause_s << " " << lag_s;
      EXPECT_EQ(bench.interlock.counts().pauses, pause_s > max_s ? 10 : 0);
      if (pause_s > max_s) {
        EXPECT_NEAR(bench.interlock.counts().longest_pause_s, pause_s, 0.03);
      }
    }
}

// pass() checks that the first setpoint after it is no step.
TEST(Interlock, AnArmThatMissedSetpointsInAPauseIsNotSentAhead) {
  Bench bench;
  bench.control(0.3, slow);
  bench.talking = false, bench.losing = true;
  bench.control(0.4, slow);
  bench.talking = true, bench.losing = false;
  const int sent = bench.sent_count;
  std::set<Blocked> reasons;
  for (int tick = 0; tick < 60; ++tick) bench.control(1.0 / 60, slow), reasons.insert(bench.blocked);
  EXPECT_EQ(reasons.count(Blocked::displaced), 1U);
  EXPECT_EQ(reasons.count(Blocked::foreign_command), 0U);
  EXPECT_GT(bench.sent_count, sent) << "it goes on from where the arm is";
}

TEST(Interlock, AnArmThatIsElsewhereAfterAPauseObeysSomebodyElse) {
  Bench bench;
  bench.control(0.3, slow);
  bench.talking = false;
  bench.control(0.3, slow);
  bench.talking = true;
  bench.setpoint[0] += 0.02;
  const int sent = bench.sent_count;
  bench.control(0.05, slow);
  EXPECT_EQ(bench.blocked, Blocked::foreign_command);
  EXPECT_EQ(bench.sent_count, sent);
}

// Setpoints that leave late are no reason to hurry: pass() checks rates and accelerations.
TEST(Interlock, ALateThreadCatchesUpWithinTheLimits) {
  for (const double late_s : {0.004, 0.02, 0.06}) {
    Bench bench;
    for (int k = 0; k < 20; ++k) {
      bench.control(0.2, k % 4 < 2 ? Eigen::Vector4d(slow * 3) : Eigen::Vector4d(-slow * 3));
      bench.stalled_until_s = bench.now_s + late_s;
    }
    bench.interlock.release();
    bench.pass(1);
    EXPECT_FALSE(bench.interlock.set_point());
    EXPECT_EQ(bench.blocked, Blocked::none);
  }
}

// The process hung, and the arm is elsewhere: not one setpoint, not even to brake.
TEST(Interlock, AfterAHangNothingIsSentUntilTheLoopBeginsAnew) {
  for (const double hung_s : {0.6, 5.0, 30.0}) {
    Bench bench;
    bench.control(0.3, slow);
    const int sent = bench.sent_count;
    bench.now_s += hung_s;
    bench.setpoint += Eigen::Vector4d(0.075, 0, 0, 0);
    bench.pass(0.1);
    EXPECT_EQ(bench.sent_count, sent);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::loop_late);
    bench.interlock.on_suspended(bench.now_s);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::loop_late);
  }
}

// By hand or by its own program, which publishes no command then.
TEST(Interlock, AnArmThatMovesByItselfIsNotMoved) {
  for (const double period_s : {0.004, 0.05}) {
    Bench bench;
    double next_s = 0;
    const auto say = [&](double rate) {
      for (int k = 0; k < 500; ++k, bench.now_s += tick_s) {
        bench.setpoint[0] += rate * tick_s;
        if (bench.now_s < next_s) continue;
        next_s = bench.now_s + period_s;
        bench.hear(1, 0, bench.setpoint), bench.hear(2, 0, bench.setpoint + bench.sag);
        bench.interlock.tick(bench.now_s);
      }
    };
    say(0);
    bench.interlock.state(bench.now_s);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
    say(0.02);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::moving);
    say(0);
    bench.interlock.state(bench.now_s);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
  }
}

TEST(Interlock, OfANewArmNothingIsKnown) {
  for (const double silence_s : {0.3, 0.52, 0.6, 3.0}) {
    Bench bench;
    bench.control(0.3, slow);
    bench.talking = false;
    bench.control(silence_s, slow);
    const int sent = bench.sent_count;
    for (int k = 0; k < 50; ++k) {
      bench.hear(1, 7, bench.setpoint), bench.hear(2, 7, bench.setpoint);
      bench.control(1.0 / 60, slow);
      EXPECT_NE(bench.blocked, Blocked::none);
    }
    EXPECT_EQ(bench.sent_count, sent);
    EXPECT_EQ(bench.blocked, Blocked::no_operating_state);
    bench.hear(0, 7, bench.setpoint);
  }
}

TEST(Interlock, TheArmMayFollowLateAndRoundASetPoint) {
  for (const double rounding_rad : {0.0, 1e-6, 5e-5, 2e-4, 1e-3}) {
    Bench bench;
    bench.lag_s = 0.24;
    bench.rounding_rad = rounding_rad;
    Random random(1);
    Eigen::Vector4d velocity = slow;
    for (int k = 0; k < 200; ++k) {
      if (k % 5 == 0) velocity = slow.cwiseProduct(Eigen::Vector4d::NullaryExpr([&] { return random.uniform(-1, 1); }));
      bench.control(0.1, velocity);
      EXPECT_EQ(bench.blocked, Blocked::none) << rounding_rad;
    }
    EXPECT_GT(bench.sent_count, 9950);
  }
}

// A quarter of a second to the arm, and its answer was on its way for nearly as long as answers count.
TEST(Interlock, TheWayBackCountsByTheStamp) {
  Bench bench;
  bench.lag_s = 0.2;
  bench.control(0.5, slow);
  JointMessage late = bench.message(bench.followed());
  bench.talking = false;
  bench.pass(max_s - 4 * tick_s);
  bench.interlock.on_setpoint(late, bench.now_s);
  EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
}

TEST(Interlock, DoesNotStartWhereTheArmIsFarFromItsSetPoint) {
  Bench bench;
  bench.sag[1] = 0.06;
  bench.control(0.5, slow);
  EXPECT_EQ(bench.sent_count, 0);
  EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::far_from_setpoint);
}

TEST(Interlock, ObservesOnlyUntilMotionIsEnabled) {
  Bench bench(config_of(false));
  bench.control(1, slow);
  EXPECT_EQ(bench.sent_count, 0);
  EXPECT_EQ(bench.interlock.counts().set_points, 0);
  EXPECT_GT(bench.interlock.counts().withheld, 450);
  ASSERT_TRUE(bench.interlock.set_point());
  EXPECT_TRUE((*bench.interlock.set_point() - bench.setpoint).isApprox(slow, 0.1));
  bench.interlock.on_foreign_command(bench.now_s);  // others may move what is only observed
  EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
  EXPECT_FALSE(bench.interlock.state(bench.now_s).follows);
  Bench led(config_of(true));
  led.control(1, slow);
  EXPECT_TRUE(led.interlock.state(led.now_s).follows);
}

TEST(Interlock, ReleasedOrWithoutTheLoopItBrakesToRestAndIsSilent) {
  for (const bool released : {true, false}) {
    Bench bench;
    bench.control(0.5, slow);
    const Eigen::Vector4d shift = bench.setpoint - bench.path.at(bench.now_s - tick_s).position;
    if (released) bench.interlock.release();
    bench.pass(0.5);
    const int sent = bench.sent_count;
    EXPECT_EQ(bench.interlock.velocities(), std::vector<double>(5, 0.0));
    EXPECT_LT((bench.setpoint - shift - bench.path.at(bench.now_s).position).norm(), 1e-5);
    bench.pass(0.5);
    EXPECT_EQ(bench.sent_count, sent);
    bench.control(0.5, slow);
    EXPECT_GT(bench.sent_count, sent + 200);
  }
}

// One topic after the other: not one of a second arm's messages is used, and none is sent while there is one.
TEST(Interlock, OfTwoArmsOfANameNeitherIsMoved) {
  for (int topic = 0; topic < 3; ++topic) {
    Bench bench;
    bench.control(0.3, slow);
    int sent = 0;
    for (int k = 0; k < 10; ++k) {
      bench.hear(topic, 7, bench.setpoint + slow);
      EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::second_source);
      bench.control(0.05, slow);
      if (k == 4) sent = bench.sent_count;  // it has braked
    }
    EXPECT_EQ(bench.sent_count, sent);
    bench.control(0.6, Eigen::Vector4d::Zero());
    if (topic == 0) {
      EXPECT_EQ(bench.blocked, Blocked::no_operating_state) << "either arm may have said the last one";
      bench.enable();
      bench.control(0.1, Eigen::Vector4d::Zero());
    }
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
  }
}

TEST(Interlock, MovesOnlyWhileAsManyNodesReadItsSetPointsAsMay) {
  const std::vector<std::pair<std::size_t, Blocked>> wrong{{0, Blocked::no_reader}, {3, Blocked::second_reader}};
  for (const auto& [readers, why] : wrong) {
    auto config = config_of();
    config.max_readers = 2;
    Bench bench(config);
    for (const std::size_t right : {1u, 2u}) {
      bench.interlock.on_readers(right);
      bench.control(0.5, slow);
      EXPECT_EQ(bench.blocked, Blocked::none);
      const int sent = bench.sent_count;
      bench.control(0.1, slow);
      EXPECT_GT(bench.sent_count, sent);
      bench.interlock.on_readers(readers);
      bench.control(0.3, slow);
      EXPECT_EQ(bench.blocked, why);
      EXPECT_LT(bench.last_sent_s, bench.now_s - 0.2);
    }
  }
  Bench observing(config_of(false));
  observing.interlock.on_readers(0);
  observing.control(0.5, slow);
  EXPECT_EQ(observing.blocked, Blocked::none);
}

TEST(Interlock, AnArmThatWasRestartedIsTheArm) {
  for (int first = 0; first < 3; ++first) {
    SCOPED_TRACE(first);
    Bench bench;
    bench.control(0.3, slow);
    bench.talking = false;
    bench.control(0.6, slow);
    for (int k = 0; k < 3; ++k) bench.hear((first + k) % 3, 7, bench.setpoint);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::restarted);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::none);
    bench.hear(2, 0, bench.setpoint);
    EXPECT_EQ(bench.interlock.state(bench.now_s).blocked, Blocked::second_source);
  }
}

TEST(Interlock, SaysWhichJointsDoNotFit) {
  Bench bench;
  bench.pass(0.1);
  EXPECT_EQ(bench.interlock.complaint(), "");
  JointMessage message = bench.message(bench.setpoint);
  message.names[0] = "disc_1";
  bench.interlock.on_measured(message, bench.now_s);
  EXPECT_NE(bench.interlock.complaint().find("measured_js has the joints disc_1, pitch, wrist, insertion, roll"),
            std::string::npos);
  EXPECT_NE(bench.interlock.complaint().find("set_tool_type"), std::string::npos);
  bench.pass(0.1);
  EXPECT_EQ(bench.interlock.complaint(), "");
}

TEST(Interlock, CountsWhatItDrops) {
  Bench bench;
  bench.pass(0.1);
  JointMessage message = bench.message(bench.setpoint);
  message.stamp_s += 1;
  bench.interlock.on_measured(message, bench.now_s);
  message.names.clear();
  bench.interlock.on_measured(message, bench.now_s);
  message = bench.message(bench.setpoint);
  message.stamp_s = 0;
  bench.interlock.on_measured(message, bench.now_s);
  EXPECT_EQ(bench.interlock.counts().jumped, 1);
  EXPECT_EQ(bench.interlock.counts().malformed, 1);
  EXPECT_EQ(bench.interlock.counts().unstamped, 1);
  EXPECT_GE(bench.interlock.counts().joint_states, 24);
}

}  // namespace lapservo::internal::interlock_test
