#include "lapservo/crtk/interlock.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "lapservo/crtk/joint_map.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t max_joints = 64;
constexpr double silence_s = 0.5;  // from a sender's last message on another one may be the arm
constexpr double memory_s = 0.25;  // by which a setpoint that was sent is the arm's
// Tolerance for the arm's changes of a setpoint (units, coupling, rounding); beyond it the setpoint is another
// program's.
const Eigen::Vector4d same_q(2e-3, 2e-3, 2e-4, 4e-3);
constexpr double same_other = 4e-3;
// Tolerance of an arm's progress along the setpoints. An arm that rounds them all alike keeps their order.
const Eigen::Vector4d same_place(1e-4, 1e-4, 1e-5, 2e-4);

bool all_finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

}  // namespace

Interlock::Interlock(const InterlockConfig& config)
    : config_(config), measured_clock_(config.max_age_s), setpoint_clock_(config.max_age_s) {}

// Places of the four joints; nullopt, and counted, for an unusable message.
std::optional<Interlock::Places> Interlock::places_in(const JointMessage& message) {
  const bool sized = message.names.size() <= max_joints && message.names.size() == message.positions.size();
  const auto places = sized ? find_joints(config_.joints, message.names) : std::nullopt;
  complaint_ = sized && !places ? unfit_joints(config_.joints, message.names) : "";
  if (!places) ++counts_.malformed;
  return places;
}

// Whether a message is of the topic's first sender or, when nothing has come for a while, of the one after it.
bool Interlock::is_of(Source& source, std::uint64_t sender, const std::optional<double>& heard_s, double arrival_s) {
  if (source.value_or(sender) != sender && heard_s && arrival_s - *heard_s <= silence_s) {
    second_s_ = arrival_s;
    watch(arrival_s);
    return false;
  }
  source = sender;
  return true;
}

std::optional<double> Interlock::stamped(StampClock& clock, const JointMessage& message, double arrival_s) {
  const StampClock::Reading measured = clock.read(message.stamp_s, arrival_s);
  if (measured.verdict == StampVerdict::fresh) return measured.time_s;
  static const std::map<StampVerdict, long InterlockCounts::*> counts{
      {StampVerdict::repeated, &InterlockCounts::repeated},
      {StampVerdict::late, &InterlockCounts::late},
      {StampVerdict::jumped, &InterlockCounts::jumped},
      {StampVerdict::unusable, &InterlockCounts::unstamped}};
  ++(counts_.*counts.at(measured.verdict));
  return std::nullopt;
}

Eigen::Vector4d Interlock::q_of(const JointMessage& message, const Places& places) const {
  Eigen::Vector4d positions;
  for (int i = 0; i < 4; ++i) positions[i] = message.positions[places[i]];
  return q_from_joints(config_.joints, positions);
}

void Interlock::on_measured(const JointMessage& message, double arrival_s) {
  const Source before = measured_source_;
  if (!is_of(measured_source_, message.source, measured_s_, arrival_s)) return;
  if (before.value_or(message.source) != message.source) state_source_.reset();  // an arm that was restarted
  measured_s_ = arrival_s;
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
  if (!is_of(setpoint_source_, message.source, setpoint_s_, arrival_s)) return;
  setpoint_s_ = arrival_s;
  const auto places = places_in(message);
  if (!places || !all_finite(message.positions)) return;
  const auto time_s = stamped(setpoint_clock_, message, arrival_s);
  if (!time_s) return;
  setpoint_ = Reading{*time_s, arrival_s, message.positions, q_of(message, *places)};
  if (!moving_) {
    names_ = message.names;
    places_ = *places;
  } else if (config_.motion_enabled && (message.names != names_ || !is_ours(*setpoint_) || goes_back(*setpoint_))) {
    on_foreign_command(arrival_s);
  }
  watch(arrival_s);
}

void Interlock::on_operating_state(const OperatingStateMessage& message, double arrival_s) {
  if (!is_of(state_source_, message.source, measured_s_, arrival_s))
    return;  // a rare message: the arm's joints show its presence
  operating_state_ = message;
  watch(arrival_s);
}

void Interlock::on_foreign_command(double arrival_s) {
  if (!config_.motion_enabled) return;
  foreign_s_ = arrival_s;
  watch(arrival_s);
}

// An arm that follows the setpoints does not go back to one that it has passed: what it reports then is of another
// program, whose commands alternate with ours.
bool Interlock::goes_back(const Reading& setpoint) {
  std::optional<double> first_s, last_s;
  for (const Sent& sent : sent_) {
    if (((sent.q - setpoint.q).array().abs() > same_place.array()).any()) continue;
    if (!first_s) first_s = sent.time_s;
    last_s = sent.time_s;
  }
  if (!first_s) return false;
  if (*last_s < passed_s_) return true;
  passed_s_ = std::max(passed_s_, *first_s);
  return false;
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
  if (untold_ != Blocked::none) return;
  path_ = path;
  released_ = false;
}

Blocked Interlock::blocked(double now_s) const {
  if (foreign_s_ && now_s - *foreign_s_ <= config_.max_age_s) return Blocked::foreign_command;
  if (second_s_ && now_s - *second_s_ <= silence_s) return Blocked::second_source;
  if (config_.motion_enabled && readers_.value_or(1) > config_.max_readers) return Blocked::second_reader;
  if (!finite_) return Blocked::non_finite_joints;
  if (operating_state_) {
    if (operating_state_->state != to_string(OperatingState::enabled)) return Blocked::not_enabled;
    if (!operating_state_->is_homed) return Blocked::not_homed;
    if (operating_state_->is_busy) return Blocked::busy;
  }
  if (!measured_) return Blocked::no_joint_states;
  if (now_s - measured_->time_s > config_.max_age_s) return Blocked::old_joint_states;
  if (!operating_state_) return Blocked::no_operating_state;
  if (!setpoint_ || now_s - setpoint_->time_s > config_.max_age_s) return Blocked::no_setpoint;
  if (config_.motion_enabled && readers_ == 0u) return Blocked::no_reader;
  const Eigen::Array4d distance = (setpoint_->q - measured_->q).array().abs();
  return !moving_ && (distance > config_.max_distance.array()).any() ? Blocked::far_from_setpoint : Blocked::none;
}

void Interlock::watch(double now_s) {
  const Blocked why = blocked(now_s);
  if (why == Blocked::none) return;
  if (untold_ == Blocked::none || is_silence(untold_)) untold_ = why;
  blocked_s_ = now_s;
  forget_path();
}

void Interlock::forget_path() {
  moving_ = false;
  path_.reset();
  sent_.clear();
}

JointState Interlock::state(double now_s) {
  watch(now_s);
  JointState state;
  state.follows = config_.motion_enabled;
  state.blocked = std::exchange(untold_, Blocked::none);
  if (measured_) state.time_s = measured_->time_s, state.q = JointVector::from_vector(measured_->q);
  if (operating_state_)
    state.operating_state = operating_state_from_string(operating_state_->state).value_or(OperatingState::disabled);
  return state;
}

void Interlock::start(double now_s) {
  last_ = setpoint_->q;
  shift_ = last_ - path_->at(now_s).position;
  others_ = setpoint_->positions;
  passed_s_ = now_s;
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

std::vector<double> Interlock::velocities() const {
  std::vector<double> velocities(others_.size(), 0.0);
  const Eigen::Vector4d at_rest = Eigen::Vector4d::Zero();
  const Eigen::Vector4d joints = joints_from_q(config_.joints, velocity_) - joints_from_q(config_.joints, at_rest);
  for (int i = 0; i < 4; ++i) velocities[places_[i]] = joints[i];
  return velocities;
}

// Where it is to be this period, as far as the limits allow; true when it is there.
bool Interlock::approach(const Eigen::Vector4d& wanted) {
  const Eigen::Vector4d step = config_.limits.rate * config_.period_s, away = within_limits(wanted) - last_;
  const Eigen::Vector4d taken = away.cwiseMax(-step).cwiseMin(step);
  last_ += taken;
  velocity_ = taken / config_.period_s;
  return taken == away;
}

std::optional<std::vector<double>> Interlock::tick(double now_s) {
  watch(now_s);
  if (path_ && !path_->at(now_s).position.allFinite()) forget_path();
  if (!path_) return std::nullopt;
  // While the arm could not be moved by us it may have been by others.
  if (!moving_ && !(setpoint_->arrival_s > blocked_s_)) return std::nullopt;
  if (!moving_) start(now_s);
  const MotionState motion = path_->at(now_s);
  const bool there = approach(motion.position + shift_);
  if (there && motion.velocity.isZero()) velocity_.setZero();
  if (!last_.allFinite()) {
    untold_ = Blocked::non_finite_joints;
    blocked_s_ = now_s;
    forget_path();
    return std::nullopt;
  }
  sent_.push_back({now_s, last_});
  while (now_s - sent_.front().time_s > memory_s + config_.max_age_s) sent_.pop_front();
  const std::vector<double> positions = all_joints();
  if (released_ && there && motion.velocity.isZero()) forget_path();
  ++(config_.motion_enabled ? counts_.set_points : counts_.withheld);
  return config_.motion_enabled ? std::optional(positions) : std::nullopt;
}

}  // namespace lapservo::internal
