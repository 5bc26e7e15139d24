#include "lapservo/robot/supervisor.h"

#include <fmt/format.h>

#include "lapservo/core/words.h"

namespace lapservo {
namespace {

Blocked arm_of(const JointState& state, double now_s, double max_age_s) {
  if (state.blocked != Blocked::none) return state.blocked;
  if (!state.q.vector().allFinite()) return Blocked::non_finite_joints;
  if (state.operating_state != OperatingState::enabled) return Blocked::not_enabled;
  return now_s - state.time_s <= max_age_s ? Blocked::none : Blocked::old_joint_states;
}

constexpr internal::Words<Blocked, 18> remedies{
    {{Blocked::no_joint_states, "check the arm's namespace and the names of its joints"},
     {Blocked::old_joint_states, "the arm is silent: restore its joint states"},
     {Blocked::non_finite_joints, "check the arm"},
     {Blocked::no_setpoint, "its setpoint_js is missing or late: an arm that is enabled and homed sends it"},
     {Blocked::no_operating_state, "let the arm repeat its operating_state"},
     {Blocked::not_homed, "home the arm"},
     {Blocked::busy, "wait until the arm's own motion has ended"},
     {Blocked::far_from_setpoint, "let the arm settle at its own setpoint"},
     {Blocked::foreign_command, "another program commands the arm: end that"},
     {Blocked::second_source, "two programs publish the arm's states: end one of them"},
     {Blocked::restarted, "another program than before publishes the arm's states"},
     {Blocked::moving, "it moves by itself, or another program moves it: let it come to rest"},
     {Blocked::second_camera, "another program publishes the camera's images, too or instead: check whose they are"},
     {Blocked::second_reader, "other nodes than the arm's read servo_jp: end them, or allow their number"},
     {Blocked::no_reader, "nobody reads servo_jp: start the arm"},
     {Blocked::displaced, "the arm is not where it was sent: look what moved or blocked it, or lost the setpoints"},
     {Blocked::loop_late, "the loop stood still: look where the arm is"},
     {Blocked::operator_absent, "press what says that the operator is present"}}};

std::string names_of(const Commanders& holders) {
  constexpr const char* names[]{"the program", "the page", "a program on the topic"};
  std::string text;
  for (const Commander& who : holders) text += (text.empty() ? "" : " and ") + std::string(names[who.kind]);
  return text;
}

}  // namespace

Supervisor::Supervisor(Robot& robot, const Clock& clock, const SupervisorConfig& config)
    : robot_(robot), clock_(clock), config_(config), suspension_(clock) {
  if (robot.is_simulated()) config_.settle_s = 0;
}

JointState Supervisor::state() {
  JointState state = robot_.state();
  operating_state_ = state.other_state.empty() ? to_string(state.operating_state) : state.other_state;
  input_.time_s = clock_.now_s();
  input_.arm = arm_of(state, input_.time_s, config_.max_reading_age_s);
  if (input_.arm == Blocked::none) input_.arm = std::exchange(reported_, Blocked::none);
  input_.follows = state.follows;
  input_.suspended = suspension_.was_suspended();
  // In the step before, too: the loop begins where the joints were then.
  input_.at_rest = !path_ || path_->at(state_.time_s).velocity.isZero();
  input_.operator_present = !is_present_ || is_present_();
  if (state.started) start(Commander::program, input_.time_s);
  const bool was_armed = armed();
  state_ = next(state_, input_, config_);
  input_.stops.clear();
  input_.starts.clear();
  if (was_armed && !armed()) robot_.release();
  if (!armed() && state.operating_state == OperatingState::enabled) state.operating_state = OperatingState::paused;
  state.started = state_.started;
  state.blocked = blocked();
  return state;
}

void Supervisor::send(const JointPath& path) {
  if (!armed()) return;
  path_ = path;
  robot_.send(path);
}

void Supervisor::start(Commander who, double said_s, bool force) {
  input_.starts.push_back({who, said_s, force});
}

void Supervisor::tell_loop(const std::string& hold_reason, Blocked event) {
  input_.loop_holds = !hold_reason.empty();
  input_.loop_event = event;
  if (!armed()) return;
  loop_reason_ = hold_reason;
  if (event == Blocked::none && input_.loop_holds)
    loop_reason_ += fmt::format(" for more than {} s", config_.max_loop_hold_s);
}

void Supervisor::end() {
  input_.ended = true;
  state_.phase = SupervisorState::Phase::held;
  state_.obstacle = Blocked::ended;
  robot_.release();
}

bool Supervisor::can_start() const {
  return !input_.ended && input_.arm == Blocked::none && input_.operator_present;
}

Blocked Supervisor::blocked() const {
  if (armed()) return Blocked::none;
  if (state_.obstacle != Blocked::none) return state_.obstacle;
  return state_.phase == SupervisorState::Phase::held ? state_.reason : Blocked::arming;
}

std::string Supervisor::remedy(Blocked obstacle) const {
  if (obstacle == Blocked::not_enabled) return fmt::format("the arm is {}: enable it", operating_state_);
  return std::string(internal::word_of(remedies, obstacle));
}

std::string Supervisor::text() const {
  using Phase = SupervisorState::Phase;
  if (armed()) return "";
  std::string part;
  if (blocked() == Blocked::ended) return "hold: ended";
  if (blocked() == Blocked::held) {
    part = fmt::format("by {}: start there, or with force", names_of(state_.held_by));
    if (input_.arm != Blocked::none) part += fmt::format("; {}: {}", to_string(input_.arm), remedy(input_.arm));
  } else if (blocked() == Blocked::arming) {
    part = fmt::format("the arm has to be ready for {} s", config_.settle_s);
  } else if (state_.obstacle != Blocked::none) {
    part = remedy(state_.obstacle) + (state_.phase == Phase::held ? ", then start" : "");
  } else {
    part = (state_.reason == Blocked::loop_held ? loop_reason_ + "; " : "") + "say start to continue";
  }
  return fmt::format("hold: {} ({})", to_string(blocked()), part);
}

}  // namespace lapservo
