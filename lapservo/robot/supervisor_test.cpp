#include "lapservo/robot/supervisor.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::supervisor_test {

constexpr double tick_s = 0.01;
const Eigen::Vector4d slow(0.1, -0.1, 0.01, 0.3), at_rest(1e-4, 1e-4, 5e-5, 1e-4);

// An arm that samples its path at once, and the loop's ticks, on a clock that only this test moves.
class Bench : public Robot, public Clock {
 public:
  explicit Bench(double passed_s = 0) { pass(passed_s); }

  JointState state() override {
    JointState state{now - reading_age_s, JointVector::from_vector(q), operating_state};
    state.blocked = pulse == Blocked::none ? blocked : pulse;
    pulse = Blocked::none;
    return state;
  }
  void send(const JointPath& sent) override { path = sent, ++sends, released = false; }
  void release() override { released = true; }
  bool is_simulated() const override { return simulated; }
  double now_s() const override { return now; }
  double suspended_s() const override { return suspended; }
  void sleep_until(double time_s) override { now = time_s; }

  // As the loop does once a period: starts anew where the arm is while it is held.
  void pass(double duration_s) {
    for (const double end_s = now + duration_s - 1e-9; now < end_s;) {
      const JointState state = supervisor.state();
      if (state.operating_state != OperatingState::enabled) {
        wanted.reset(now, q);
      } else {
        wanted.ramp_to(now, slow, tick_s);
        supervisor.send(wanted);
      }
      starts += state.started;
      now += tick_s;
      if (path && operating_state == OperatingState::enabled) q = path->at(now).position;
      if (operating_state != OperatingState::enabled) path.reset();
    }
  }
  bool moves(double duration_s = 0.2) {
    const Eigen::Vector4d before = q;
    pass(duration_s);
    return ((q - before).cwiseAbs().array() > at_rest.array()).any();
  }
  void start(Commander who = Commander::program, bool force = false) { supervisor.start(who, now, force); }
  bool moves_after_start(Commander who = Commander::program, bool force = false) {
    start(who, force);
    return moves();
  }

  double now = 100, suspended = 0, reading_age_s = 0;
  OperatingState operating_state = OperatingState::enabled;
  Blocked blocked = Blocked::none, pulse = Blocked::none;
  bool simulated = false, released = false;
  Eigen::Vector4d q{0.1, 1.5, 0.08, 0.5};
  int sends = 0, starts = 0;
  JointPath wanted{Eigen::Vector4d(2, 2, 0.2, 7.5)};
  std::optional<JointPath> path;
  Supervisor supervisor{*this, *this};
};

TEST(Supervisor, TheFirstStartIsThatWhichMadeIt) {
  Bench bench;
  EXPECT_FALSE(bench.moves(0.5));
  EXPECT_EQ(bench.supervisor.text(), "hold: arming (the arm has to be ready for 0.5 s)");
  EXPECT_TRUE(bench.moves());
  EXPECT_EQ(bench.starts, 1);
  EXPECT_EQ(bench.supervisor.text(), "");
}

TEST(Supervisor, NobodyHasToWaitForAnArmThatIsSimulated) {
  Bench arm;
  arm.simulated = true;
  Supervisor supervisor(arm, arm);
  EXPECT_EQ(supervisor.state().operating_state, OperatingState::enabled);
}

// An arm that has not spoken yet is waited for; one that says that it is not ready is not.
TEST(Supervisor, TheFirstStartWaitsForTheArmsFirstWordsOnly) {
  for (const Blocked blocked :
       {Blocked::no_joint_states, Blocked::no_operating_state, Blocked::no_setpoint, Blocked::no_reader}) {
    Bench bench;
    bench.blocked = blocked;
    bench.pass(14);
    bench.blocked = Blocked::none;
    bench.pass(0.6);
    EXPECT_TRUE(bench.moves()) << to_string(blocked);
    Bench late;
    late.blocked = blocked;
    late.pass(16);
    late.blocked = Blocked::none;
    EXPECT_FALSE(late.moves(2)) << to_string(blocked);
  }
  for (const Blocked blocked : {Blocked::not_homed, Blocked::busy, Blocked::foreign_command, Blocked::second_reader}) {
    Bench bench;
    bench.blocked = blocked;
    bench.pass(0.1);
    bench.blocked = Blocked::none;
    EXPECT_FALSE(bench.moves(2)) << to_string(blocked);
  }
}

// Whatever an operator or the arm does: held within a tick, at rest within the limits, silent, and then no joint moves
// until a start, however long the arm has been ready again.
TEST(Supervisor, AfterAnythingButTrackingItIsHeldUntilAStart) {
  using Event = std::function<void(Bench&, bool)>;
  const auto state = [](OperatingState is) -> Event {
    return [is](Bench& b, bool on) { b.operating_state = on ? is : OperatingState::enabled; };
  };
  const auto block = [](Blocked is) -> Event {
    return [is](Bench& b, bool on) { b.blocked = on ? is : Blocked::none; };
  };
  const std::vector<std::pair<std::string, Event>> events{
      {"not_enabled", state(OperatingState::disabled)},
      {"not_enabled", state(OperatingState::fault)},
      {"not_homed", block(Blocked::not_homed)},
      {"busy", [](Bench& b, bool on) { b.pulse = on ? Blocked::busy : Blocked::none; }},
      {"foreign_command", block(Blocked::foreign_command)},
      {"non_finite_joints", block(Blocked::non_finite_joints)},
      {"displaced",
       [](Bench& b, bool on) {
         b.supervisor.tell_loop(on ? "not_following" : "", on ? Blocked::displaced : Blocked::none);
       }},
  };
  for (const auto& [reason, event] : events) {
    SCOPED_TRACE(reason);
    Bench bench(1);
    event(bench, true);
    bench.pass(tick_s);
    EXPECT_FALSE(bench.supervisor.armed());
    EXPECT_EQ(to_string(bench.supervisor.blocked()), reason);
    EXPECT_TRUE(bench.released);
    const int sends = bench.sends;
    bench.pass(0.5);  // it brakes
    event(bench, false);
    EXPECT_FALSE(bench.moves(3));
    EXPECT_EQ(bench.sends, sends);
    EXPECT_EQ(bench.supervisor.text(), "hold: " + reason + " (say start to continue)");
    EXPECT_TRUE(bench.moves_after_start());
    EXPECT_EQ(bench.starts, 2);
  }
}

TEST(Supervisor, ASilenceThatIsShortPassesAndALongOneNeedsAStart) {
  for (const double age_s : {0.11, static_cast<double>(NAN)}) {
    Bench bench(1);
    for (const double silence_s : {0.4, 0.6}) {
      bench.reading_age_s = age_s;
      bench.pass(tick_s);
      EXPECT_EQ(bench.supervisor.blocked(), Blocked::old_joint_states);
      EXPECT_TRUE(bench.released);
      const int sends = bench.sends;
      bench.pass(silence_s);
      EXPECT_EQ(bench.sends, sends);
      bench.reading_age_s = 0;
      EXPECT_EQ(bench.moves(), silence_s < 0.5);
    }
    EXPECT_EQ(bench.supervisor.text(), "hold: old_joint_states (say start to continue)");
    Bench stopped(1);
    stopped.blocked = Blocked::no_setpoint;
    stopped.pass(0.1);
    stopped.pulse = Blocked::busy;
    stopped.pass(tick_s);
    stopped.blocked = Blocked::none;
    EXPECT_FALSE(stopped.moves(2));
  }
}

// However long it hung; the arm has spoken all the while, and somebody may have moved it.
TEST(Supervisor, ALoopThatStoodStillNeedsAStart) {
  for (const double hung_s : {0.3, 0.6, 5.0, 30.0}) {
    Bench bench(1);
    bench.now += hung_s;
    const int sends = bench.sends;
    bench.pass(tick_s);
    EXPECT_EQ(bench.supervisor.armed(), hung_s < 0.5);
    if (hung_s < 0.5) continue;
    EXPECT_EQ(bench.sends, sends);
    EXPECT_EQ(bench.supervisor.text(), "hold: loop_late (say start to continue)");
    bench.supervisor.start(Commander::page, bench.now - hung_s / 2);  // said meanwhile
    EXPECT_FALSE(bench.moves(2));
    EXPECT_TRUE(bench.moves_after_start());
  }
}

TEST(Supervisor, AComputerThatWasSuspendedNeedsAStart) {
  Bench bench;
  for (const double read_s : {0.0, -0.2, 0.0}) {  // the second while the program waited between its two clocks
    bench.suspended = read_s;
    EXPECT_TRUE(bench.moves(1));
  }
  bench.suspended = 3;
  bench.pass(tick_s);
  EXPECT_EQ(bench.supervisor.blocked(), Blocked::loop_late);
  bench.pass(0.5);  // it brakes
  EXPECT_FALSE(bench.moves(2));
  EXPECT_TRUE(bench.moves_after_start());
}

// An arm that fell silent while the loop stood still, too, is no short silence.
TEST(Supervisor, ASilenceCountsFromWhenTheArmWasReadyLast) {
  Bench bench(1);
  bench.reading_age_s = 0.2;
  bench.now += 0.45;
  bench.pass(0.1);
  bench.reading_age_s = 0;
  EXPECT_FALSE(bench.moves(1));
}

TEST(Supervisor, AHoldDoesNotHideWhatBecomesOfTheArm) {
  Bench bench(1);
  bench.supervisor.stop(Commander::page);
  bench.pass(0.1);
  EXPECT_TRUE(bench.supervisor.can_start());
  bench.reading_age_s = 5;  // killed
  bench.pass(0.1);
  EXPECT_EQ(
      bench.supervisor.text(),
      "hold: held (by the page: start there, or with force; old_joint_states: the arm is silent: restore its joint "
      "states)");
  EXPECT_FALSE(bench.supervisor.can_start());
  bench.reading_age_s = 0;
  bench.pass(0.1);
  EXPECT_EQ(bench.supervisor.text(), "hold: held (by the page: start there, or with force)");
  EXPECT_TRUE(bench.supervisor.can_start());
}

TEST(Supervisor, WhoHoldsHasToLetGoUnlessTheStartHasForce) {
  Bench bench(1);
  bench.supervisor.stop(Commander::page);
  bench.supervisor.stop(Commander::topic);
  bench.pass(1);
  EXPECT_EQ(bench.supervisor.text(), "hold: held (by the page and a program on the topic: start there, or with force)");
  EXPECT_FALSE(bench.moves_after_start(Commander::program));
  EXPECT_FALSE(bench.moves_after_start(Commander::page));
  EXPECT_EQ(bench.supervisor.text(), "hold: held (by a program on the topic: start there, or with force)");
  EXPECT_TRUE(bench.moves_after_start(Commander::topic));
  bench.supervisor.stop({Commander::topic, 1});
  bench.pass(1);
  EXPECT_FALSE(bench.moves_after_start({Commander::topic, 2}));
  EXPECT_TRUE(bench.moves_after_start({Commander::topic, 1}));
  bench.supervisor.stop(Commander::topic);
  bench.pass(1);
  EXPECT_TRUE(bench.moves_after_start(Commander::page, true));
}

TEST(Supervisor, WhatIsReportedNeedsAStart) {
  for (const double after_s : {0.0, 0.3, 1.0}) {
    Bench bench(after_s);
    bench.supervisor.report(Blocked::second_camera);
    bench.supervisor.tell_loop("");
    bench.pass(0.3);
    EXPECT_FALSE(bench.moves(1)) << after_s;
    EXPECT_EQ(bench.supervisor.blocked(), Blocked::second_camera);
    bench.start();
    EXPECT_TRUE(bench.moves(1));
  }
}

TEST(Supervisor, WithoutTheOperatorNothingMoves) {
  Bench bench;
  bool present = false;
  bench.supervisor.watch_operator([&] { return present; });
  EXPECT_FALSE(bench.moves(2));
  EXPECT_EQ(bench.supervisor.text(), "hold: operator_absent (press what says that the operator is present)");
  present = true;
  EXPECT_TRUE(bench.moves(0.7));
  present = false;
  bench.pass(0.5);
  EXPECT_FALSE(bench.moves(1));
  bench.start(Commander::topic, true);
  EXPECT_FALSE(bench.moves(1));
  present = true;
  EXPECT_FALSE(bench.moves(1));
  EXPECT_TRUE(bench.moves_after_start());
}

TEST(Supervisor, AHoldOfTheLoopOfMoreThanTwoSecondsNeedsAStart) {
  Bench bench(1);
  for (const double held_s : {1.9, 2.1}) {
    bench.supervisor.tell_loop("marker_lost");
    bench.pass(held_s);
    bench.supervisor.tell_loop("");
    EXPECT_EQ(bench.moves(), held_s < 2);
  }
  EXPECT_EQ(bench.supervisor.text(), "hold: loop_held (marker_lost for more than 2 s; say start to continue)");
  Bench first;  // whose camera has not begun
  first.supervisor.tell_loop("no_image_yet");
  first.pass(10);
  first.supervisor.tell_loop("");
  EXPECT_TRUE(first.moves());
}

TEST(Supervisor, TheEndIsForGood) {
  Bench bench(1);
  bench.supervisor.end();
  EXPECT_TRUE(bench.released);
  bench.pass(0.5);
  bench.start(Commander::program, true);
  EXPECT_FALSE(bench.moves(2));
}

TEST(Supervisor, AnArmThatDoesNotFollowNeedsNoStart) {
  SupervisorInput input;
  input.follows = false;
  SupervisorState state;
  for (const Blocked arm : {Blocked::none, Blocked::busy, Blocked::none}) {
    input.time_s += tick_s;
    input.arm = arm;
    state = next(state, input, {});
    EXPECT_EQ(state.phase == SupervisorState::Phase::armed, arm == Blocked::none);
  }
}

// The motion that the table allows, by all past events and not by a state.
class Model {
 public:
  bool may_move(const SupervisorInput& input, const SupervisorConfig& config) {
    const double now = input.time_s;
    const double before_s = last_s_.value_or(now);
    const bool ready = input.arm == Blocked::none && now >= before_s, late = now - before_s > config.max_silence_s;
    last_s_ = now;
    if (late && granted_) granted_ = moved_ = false, held_s_ = now, silent_s_.reset();
    if (!ready || late) ready_s_ = INFINITY;
    if (ready) ready_s_ = std::min(ready_s_, now);
    for (const Commander& who : input.stops) holders_.insert(who);
    bool start = false;
    for (const auto& said : input.starts) {
      if (!input.stops.empty() || !(std::abs(now - said.said_s) <= config.start_lasts_s) || said.said_s < held_s_)
        continue;
      start = true;
      said.force ? holders_.clear() : static_cast<void>(holders_.erase(said.who));
    }
    const bool alone = holders_.empty() && input.operator_present && !input.ended, free = ready && alone;
    if (!input.stops.empty() || (!free && free_)) held_s_ = now;
    free_ = free;
    const bool silent = !ready && (input.arm == Blocked::none || is_silence(input.arm));
    if (moved_) silent_s_ = last_ready_s_;
    if (ready) last_ready_s_ = now;
    const bool passes = alone && silent && silent_s_ && now - *silent_s_ <= config.max_silence_s;
    const bool passed = free && silent_s_ && input.at_rest;
    if (!passes && !(free && !input.at_rest)) silent_s_.reset();
    if (!free && !passes && std::exchange(granted_, false)) held_s_ = now;
    if (free && start) granted_ = true;
    const bool moved = moved_;
    moved_ = granted_ && (passed || (moved && free) || (free && input.at_rest && now - ready_s_ >= config.settle_s));
    if (!moved || !moved_ || !input.loop_holds) hold_s_.reset();
    if (moved && moved_ && input.loop_holds && !hold_s_) hold_s_ = now;
    const bool too_long = hold_s_ && now - *hold_s_ > config.max_loop_hold_s;
    if (moved && moved_ && (input.loop_event != Blocked::none || too_long)) granted_ = moved_ = false, held_s_ = now;
    return moved_;
  }

 private:
  std::optional<double> last_s_;
  double ready_s_ = INFINITY, last_ready_s_ = -1e300, held_s_ = -1e300;
  std::optional<double> hold_s_, silent_s_;
  Commanders holders_;
  bool granted_ = false, moved_ = false, free_ = true;
};

SupervisorInput any_input(internal::Random& random, const SupervisorInput& before) {
  const auto happens = [&](double probability) { return random.uniform() < probability; };
  SupervisorInput input;
  input.time_s = before.time_s + (happens(0.002) ? -1 : 1) * random.uniform(0, happens(0.02) ? 1 : 0.1);
  const double wrong = before.arm == Blocked::none ? 0.02 : 0.6;
  if (happens(wrong)) input.arm = static_cast<Blocked>(1 + static_cast<int>(random.uniform(0, 13)));
  input.at_rest = happens(0.7);
  input.operator_present = happens(before.operator_present ? 0.99 : 0.5);
  input.loop_holds = happens(before.loop_holds ? 0.97 : 0.03);
  if (happens(0.002)) input.loop_event = Blocked::displaced;
  input.ended = before.ended || happens(0.0005);
  for (const Commander who : {Commander(Commander::program), Commander(Commander::page), Commander(Commander::topic, 1),
                              Commander(Commander::topic, 2)}) {
    if (happens(0.01)) input.stops.insert(who);
    const double ago_s = happens(0.1) ? NAN : random.uniform(-1.2, 1.5);
    if (happens(0.06)) input.starts.push_back({who, input.time_s - ago_s, happens(0.1)});
  }
  return input;
}

// 1,000 sequences: there is no motion but where the model allows it, and no hold where it does.
TEST(Supervisor, MovesExactlyWhereTheTableAllowsIt) {
  constexpr std::uint64_t seed = 41;
  internal::Random random(seed);
  const SupervisorConfig config;
  long armed = 0, steps = 0;
  for (int sequence = 0; sequence < 1000; ++sequence) {
    SupervisorState state;
    state.phase = SupervisorState::Phase::held;  // what the first start waits for is in tests of its own
    state.tracked = true;
    Model model;
    SupervisorInput input;
    for (int k = 0; k < 200; ++k, ++steps) {
      input = any_input(random, input);
      state = next(state, input, config);
      const bool moves = state.phase == SupervisorState::Phase::armed;
      ASSERT_EQ(moves, model.may_move(input, config)) << "seed " << seed << ", sequence " << sequence << ", step " << k;
      armed += moves;
    }
  }
  EXPECT_GT(armed, steps / 20);
}

}  // namespace lapservo::internal::supervisor_test
