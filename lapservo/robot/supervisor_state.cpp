#include "lapservo/robot/supervisor_state.h"

#include <cmath>

namespace lapservo {
namespace {

using Phase = SupervisorState::Phase;

// Nothing that happened to the arm: it has not said it yet, or comes to rest.
bool may_come_yet(Blocked obstacle) {
  return is_silence(obstacle) || obstacle == Blocked::no_joint_states || obstacle == Blocked::no_operating_state ||
         obstacle == Blocked::no_reader || obstacle == Blocked::operator_absent || obstacle == Blocked::moving;
}

// Whether a start was given in time and no stop; its commander then does not hold any more.
bool take_starts(SupervisorState& state, const SupervisorInput& input, const SupervisorConfig& config) {
  if (!input.stops.empty()) return false;
  bool said = false;
  for (const auto& start : input.starts) {
    if (!(std::abs(input.time_s - start.said_s) <= config.start_lasts_s) || start.said_s < state.held_since_s) continue;
    said = true;
    state.held_by.erase(start.who);
    if (start.force) state.held_by.clear();
  }
  return said;
}

// By a clock that did not run backwards.
Blocked arm_of(const SupervisorState& state, const SupervisorInput& input) {
  if (input.arm == Blocked::none && !(input.time_s >= state.time_s)) return Blocked::old_joint_states;
  return input.arm;
}

Blocked obstacle_of(const SupervisorState& state, const SupervisorInput& input, Blocked arm) {
  if (input.ended) return Blocked::ended;
  if (!state.held_by.empty()) return Blocked::held;
  const bool says_so = arm != Blocked::none && !is_silence(arm);
  return says_so || input.operator_present ? arm : Blocked::operator_absent;
}

void hold(SupervisorState& state, Blocked reason) {
  if (state.phase != Phase::held) state.held_since_s = state.time_s;
  state.phase = Phase::held;
  state.reason = reason;
  state.loop_holds_since_s.reset();
}

// Whether what is in the way now may pass by itself.
bool may_pass(SupervisorState& state, const SupervisorConfig& config) {
  if (state.phase == Phase::connecting)
    return may_come_yet(state.obstacle) && state.time_s - *state.begun_s <= config.connect_s;
  if ((state.phase != Phase::armed && state.phase != Phase::silent) || !is_silence(state.obstacle)) return false;
  state.phase = Phase::silent;
  state.loop_holds_since_s.reset();
  return state.time_s - state.ready_s <= config.max_silence_s;
}

void watch_loop(SupervisorState& state, const SupervisorInput& input, const SupervisorConfig& config) {
  if (input.loop_event != Blocked::none) return hold(state, input.loop_event);
  if (!input.loop_holds) {
    state.tracked = true;
    return state.loop_holds_since_s.reset();
  }
  if (!state.loop_holds_since_s) state.loop_holds_since_s = input.time_s;
  const double longest_s = state.tracked ? config.max_loop_hold_s : config.connect_s;
  if (input.time_s - *state.loop_holds_since_s > longest_s) hold(state, Blocked::loop_held);
}

// Whether nobody watched the arm since the step before.
bool take_time(SupervisorState& state, const SupervisorInput& input, const SupervisorConfig& config) {
  const bool late = state.begun_s && (input.suspended || input.time_s - state.time_s > config.max_silence_s);
  if (std::isfinite(input.time_s)) state.time_s = input.time_s;
  if (!state.begun_s) state.begun_s = state.time_s;
  return late;
}

void note_ready(SupervisorState& state, bool ready, bool late) {
  if (!ready || late) state.ready_since_s.reset();
  if (!ready) return;
  state.ready_s = state.time_s;
  if (!state.ready_since_s) state.ready_since_s = state.time_s;
}

}  // namespace

SupervisorState next(SupervisorState state, const SupervisorInput& input, const SupervisorConfig& config) {
  const Blocked arm = arm_of(state, input), before = state.obstacle;
  const bool late = take_time(state, input, config);
  if (late && input.follows && state.phase != Phase::connecting && state.phase != Phase::held)
    hold(state, Blocked::loop_late);
  note_ready(state, arm == Blocked::none, late);
  state.held_by.insert(input.stops.begin(), input.stops.end());
  const bool start = take_starts(state, input, config);
  state.obstacle = obstacle_of(state, input, arm);
  if (!input.stops.empty() || (state.obstacle != Blocked::none && before == Blocked::none))
    state.held_since_s = state.time_s;
  state.started = start && state.obstacle == Blocked::none;
  if (!input.follows) {
    state.phase = state.obstacle == Blocked::none ? Phase::armed : Phase::held;
    state.reason = state.obstacle;
    return state;
  }
  if (state.obstacle != Blocked::none) {
    if (!may_pass(state, config)) hold(state, state.obstacle);
    return state;
  }
  if (state.phase == Phase::armed) {
    watch_loop(state, input, config);
    return state;
  }
  if (state.phase == Phase::held && state.started) state.phase = Phase::arming;
  const bool passed = state.phase == Phase::silent;
  const bool settled = state.phase != Phase::held && state.time_s - *state.ready_since_s >= config.settle_s;
  state.started = settled && !passed && input.at_rest;
  if ((passed || settled) && input.at_rest) state.phase = Phase::armed;
  return state;
}

}  // namespace lapservo
