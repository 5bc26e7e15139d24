#include "lapservo/crtk/interlock.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/core/words.h"
#include "lapservo/crtk/joint_map.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t max_joints = 64;
constexpr double memory_s = 0.25;  // by which a set-point that was sent is the arm's
// What an arm may make of a set-point (units, coupling, rounding) before it is somebody else's.
const Eigen::Vector4d same_q(2e-3, 2e-3, 2e-4, 4e-3);
constexpr double same_other = 4e-3;

constexpr Words<Blocked, 13> blocked_words{{{Blocked::none, "none"},
                                            {Blocked::no_joint_states, "no_joint_states"},
                                            {Blocked::old_joint_states, "old_joint_states"},
                                            {Blocked::non_finite_joints, "non_finite_joints"},
                                            {Blocked::no_setpoint, "no_setpoint"},
                                            {Blocked::no_operating_state, "no_operating_state"},
                                            {Blocked::not_enabled, "not_enabled"},
                                            {Blocked::not_homed, "not_homed"},
                                            {Blocked::busy, "busy"},
                                            {Blocked::far_from_setpoint, "far_from_setpoint"},
                                            {Blocked::held, "held"},
                                            {Blocked::foreign_command, "foreign_command"},
                                            {Blocked::stopped, "stopped"}}};
static_assert(names_all(blocked_words, Blocked::stopped));

bool all_finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

}  // namespace

std::string_view to_string(Blocked blocked) {
  return word_of(blocked_words, blocked);
}

Interlock::Interlock(const InterlockConfig& config)
    : config_(config), measured_clock_(config.max_age_s), setpoint_clock_(config.max_age_s) {}

// Of the four joints; nullopt, and counted, when the message is none to go by.
std::optional<Interlock::Places> Interlock::places_in(const JointMessage& message) {
  const bool sized = message.names.size() <= max_joints && message.names.size() == message.positions.size();
  const auto places = sized ? find_joints(config_.joints, message.names) : std::nullopt;
  if (!places) ++counts_.malformed;
  return places;
}

std::optional<double> Interlock::stamped(StampClock& clock, const JointMessage& message, double arrival_s) {
  const StampClock::Reading measured = clock.read(message.stamp_s, arrival_s);
  switch (measured.verdict) {
    case StampVerdict::fresh:
      return measured.time_s;
    case StampVerdict::repeated:
      ++counts_.repeated;
      break;
    case StampVerdict::late:
      ++counts_.late;
      break;
    case StampVerdict::jumped:
      ++counts_.jumped;
      break;
    case StampVerdict::unusable:
      ++counts_.unstamped;
      break;
  }
  return std::nullopt;
}

Eigen::Vector4d Interlock::q_of(const JointMessage& message, const Places& places) const {
  Eigen::Vector4d positions;
  for (int i = 0; i < 4; ++i) positions[i] = message.positions[places[i]];
  return q_from_joints(config_.joints, positions);
}

void Interlock::on_measured(const JointMessage& message, double arrival_s) {
  const auto places = places_in(message);
  if (!places) return;
  const auto time_s = stamped(measured_clock_, message, arrival_s);
  if (!time_s) return;
  ++counts_.joint_states;
  finite_ = all_finite(message.positions);
  if (finite_) measured_ = Reading{*time_s, arrival_s, message.positions, q_of(message, *places)};
  if (finite_) readings_.add({*time_s, JointVector::from_vector(measured_->q)});
  watch(arrival_s);
}

void Interlock::on_setpoint(const JointMessage& message, double arrival_s) {
  const auto places = places_in(message);
  if (!places || !all_finite(message.positions)) return;
  const auto time_s = stamped(setpoint_clock_, message, arrival_s);
  if (!time_s) return;
  setpoint_ = Reading{*time_s, arrival_s, message.positions, q_of(message, *places)};
  if (!moving_) {
    names_ = message.names;
    places_ = *places;
  } else if (config_.motion_enabled && (message.names != names_ || !is_ours(*setpoint_))) {
    on_foreign_command();
  }
  watch(arrival_s);
}

void Interlock::on_operating_state(const OperatingStateMessage& message) {
  operating_state_ = message;
  operating_state_known_ = true;
}

void Interlock::on_foreign_command() {
  if (config_.motion_enabled && !released_) foreign_ = true;
}

// Between those that were sent of late: the arm may interpolate, and what comes back is from a moment ago.
bool Interlock::is_ours(const Reading& setpoint) const {
  Eigen::Vector4d lower = last_, upper = last_;
  for (const Sent& sent : sent_) {
    if (setpoint.time_s - sent.time_s > memory_s) continue;
    lower = lower.cwiseMin(sent.q);
    upper = upper.cwiseMax(sent.q);
  }
  if (((setpoint.q - upper - same_q).array() > 0).any() || ((lower - same_q - setpoint.q).array() > 0).any())
    return false;
  for (std::size_t i = 0; i < others_.size(); ++i)
    if (std::find(places_.begin(), places_.end(), i) == places_.end() &&
        std::abs(setpoint.positions[i] - others_[i]) > same_other)
      return false;
  return true;
}

void Interlock::follow(const JointPath& path) {
  if (must_start_anew_ || held_) return;
  path_ = path;
  released_ = false;
}

void Interlock::hold(bool on) {
  if (held_ && !on) forget_path();
  held_ = on;
  started_ = !on;
}

void Interlock::stop() {
  stopped_ = true;
}

Blocked Interlock::blocked(double now_s) const {
  if (stopped_) return Blocked::stopped;
  if (foreign_) return Blocked::foreign_command;
  if (!finite_) return Blocked::non_finite_joints;
  if (!measured_) return Blocked::no_joint_states;
  if (now_s - measured_->time_s > config_.max_age_s) return Blocked::old_joint_states;
  if (!operating_state_known_) return Blocked::no_operating_state;
  if (operating_state_.state != to_string(OperatingState::enabled)) return Blocked::not_enabled;
  if (!operating_state_.is_homed) return Blocked::not_homed;
  if (operating_state_.is_busy) return Blocked::busy;
  if (!setpoint_ || now_s - setpoint_->time_s > config_.max_age_s) return Blocked::no_setpoint;
  const Eigen::Array4d distance = (setpoint_->q - measured_->q).array().abs();
  if (!moving_ && (distance > config_.max_distance.array()).any()) return Blocked::far_from_setpoint;
  return held_ ? Blocked::held : Blocked::none;
}

// From the moment on that something is amiss until the loop knows of it, nothing moves.
void Interlock::watch(double now_s) {
  const Blocked why = blocked(now_s);
  if (why == Blocked::none || why == Blocked::held) return;
  blocked_s_ = now_s;
  forget_path();
}

void Interlock::forget_path() {
  if (!must_start_anew_) told_ = false;
  must_start_anew_ = true;
  moving_ = false;
  path_.reset();
  sent_.clear();
}

JointState Interlock::state(double now_s) {
  watch(now_s);
  JointState state;
  state.follows = config_.motion_enabled;
  state.started = std::exchange(started_, false);
  if (measured_) state.time_s = measured_->time_s, state.q = JointVector::from_vector(measured_->q);
  const bool well = blocked(now_s) == Blocked::none;
  if (well && told_) must_start_anew_ = false;
  if (must_start_anew_) told_ = true;
  if (held_) {
    state.operating_state = OperatingState::paused;
  } else if (!must_start_anew_) {
    state.operating_state = OperatingState::enabled;
  } else if (const auto said = operating_state_from_string(operating_state_.state);
             said && *said != OperatingState::enabled) {
    state.operating_state = *said;
  }
  return state;
}

void Interlock::start(double now_s) {
  last_ = setpoint_->q;
  shift_ = last_ - path_->at(now_s).position;
  others_ = setpoint_->positions;
  moving_ = true;
}

Eigen::Vector4d Interlock::within_limits(const Eigen::Vector4d& wanted) const {
  return wanted.cwiseMax(config_.limits.lower.cwiseMin(last_)).cwiseMin(config_.limits.upper.cwiseMax(last_));
}

std::vector<double> Interlock::all_joints() const {
  std::vector<double> positions = others_;
  const Eigen::Vector4d joints = joints_from_q(config_.joints, last_);
  for (int i = 0; i < 4; ++i) positions[places_[i]] = joints[i];
  return positions;
}

std::optional<std::vector<double>> Interlock::tick(double now_s) {
  watch(now_s);
  if (released_ && path_ && path_->at(now_s).velocity.isZero()) forget_path();
  if (!path_) return std::nullopt;
  // While the arm could not be moved by us it may have been by others.
  if (!moving_ && !(setpoint_->arrival_s > blocked_s_)) return std::nullopt;
  if (!moving_) {
    start(now_s);
  } else {
    const Eigen::Vector4d step = config_.limits.rate * config_.period_s;
    const Eigen::Vector4d away = within_limits(path_->at(now_s).position + shift_) - last_;
    last_ += away.cwiseMax(-step).cwiseMin(step);
  }
  if (!last_.allFinite()) {
    stop();
    watch(now_s);
    return std::nullopt;
  }
  if (!config_.motion_enabled) {
    ++counts_.withheld;
    return std::nullopt;
  }
  sent_.push_back({now_s, last_});
  while (now_s - sent_.front().time_s > memory_s + config_.max_age_s) sent_.pop_front();
  ++counts_.set_points;
  return all_joints();
}

}  // namespace lapservo::internal
