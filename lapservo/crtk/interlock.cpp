#include "lapservo/crtk/interlock.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/printable.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/tool/wrist.h"

namespace lapservo::internal {
namespace {

constexpr std::size_t max_joints = 64;
constexpr double unwatched_s = 0.5;
constexpr double memory_s = 1;  // a setpoint that was sent since then is ours, whenever the arm reports it
// Tolerance for the arm's changes of a setpoint (units, coupling, rounding); beyond it the setpoint is another
// program's.
const Eigen::Vector4d same_q(2e-3, 2e-3, 2e-4, 4e-3);
constexpr double same_other = 4e-3;
// An arm that we do not move stays within same_q for so long; after our own motion it may settle first.
constexpr double rest_s = 0.5, settling_s = 0.2;

// An arm that does not move, or moves for somebody else, must not get another setpoint. The others still listen.
bool obeys(Blocked why) {
  switch (why) {
    case Blocked::old_joint_states:
    case Blocked::no_setpoint:
    case Blocked::non_finite_joints:
    case Blocked::second_source:
    case Blocked::second_reader:
    case Blocked::no_reader:
      return true;
    default:
      return false;
  }
}

// At a distance from where to end: slows down at half the acceleration, and the last part exponentially.
double approach_speed(double left, double acceleration) {
  constexpr double time_constant_s = 0.01;
  return std::min(left / time_constant_s, std::sqrt(acceleration * left));
}

// Whether a point lies beside the line between two others, as far as this part of same_q.
bool lies_between(const Eigen::Vector4d& q, const Eigen::Vector4d& from, const Eigen::Vector4d& to, double near = 1) {
  const Eigen::Vector4d unit = near * same_q, way = (to - from).cwiseQuotient(unit),
                        off = (q - from).cwiseQuotient(unit);
  const double length2 = way.squaredNorm();
  const double part = length2 > 0 ? std::clamp(off.dot(way) / length2, 0.0, 1.0) : 0;
  return ((off - part * way).array().abs() <= 1).all();
}

}  // namespace

InterlockConfig interlock_of(const Instrument& instrument, const JointLimits& limits_of_q, bool motion_enabled,
                             std::size_t max_readers) {
  return {.joints = instrument.joints.value(),
          .limits = limits_of_q,
          .max_readers = max_readers,
          .motion_enabled = motion_enabled,
          .wrist = wrist_names(instrument.tool)};
}

Interlock::Interlock(const InterlockConfig& config)
    : config_(config), measured_clock_(config.max_age_s), setpoint_clock_(config.max_age_s) {}

// Places of the four joints; nullopt, and counted, for an unusable message.
std::optional<Interlock::Places> Interlock::places_in(const JointMessage& message, const char* topic) {
  const bool sized = message.names.size() <= max_joints && message.names.size() == message.positions.size();
  const auto places = sized ? find_joints(config_.joints, message.names) : std::nullopt;
  complaints_[topic] = sized && !places ? unfit_joints(config_.joints, message.names) : "";
  if (!places) ++counts_.malformed;
  return places;
}

bool Interlock::is_of(FirstSender& sender, std::uint64_t source, double arrival_s) {
  const FirstSender::Verdict verdict = sender.hear(source, arrival_s);
  if (verdict == FirstSender::Verdict::other) watch(arrival_s);
  if (verdict == FirstSender::Verdict::counts_anew) {
    begin_anew(arrival_s);
    sender.hear(source, arrival_s);
  }
  return verdict != FirstSender::Verdict::other;
}

// Another arm, or the same one after its program was started again.
void Interlock::begin_anew(double arrival_s) {
  measured_sender_ = {}, setpoint_sender_ = {}, state_sender_ = {};
  measured_.reset(), setpoint_.reset(), operating_state_.reset();
  rest_.reset(), moved_s_.reset(), fault_s_.reset();
  sent_.clear();
  give_up(Blocked::restarted, arrival_s);
}

std::string Interlock::complaint() const {
  for (const auto& [topic, why] : complaints_)
    if (!why.empty()) return topic + " " + why;
  return {};
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
  if (!is_of(measured_sender_, message.source, arrival_s)) return;
  state_sender_.is_there(message.source, arrival_s);  // its messages are rare
  const auto places = places_in(message, "measured_js");
  if (!places) return;
  const auto time_s = stamped(measured_clock_, message, arrival_s);
  if (!time_s) return;
  ++counts_.joint_states;
  finite_ = all_finite(message.positions);
  if (finite_)
    measured_ =
        Reading{*time_s, arrival_s, message.positions, wrist_in(message, config_.wrist), q_of(message, *places)};
  if (finite_) readings_.add({*time_s, JointVector::from_vector(measured_->q)});
  watch_rest(arrival_s);
  watch(arrival_s);
}

void Interlock::on_setpoint(const JointMessage& message, double arrival_s) {
  if (!is_of(setpoint_sender_, message.source, arrival_s)) return;
  const auto places = places_in(message, "setpoint_js");
  if (!places || !all_finite(message.positions)) return;
  const auto time_s = stamped(setpoint_clock_, message, arrival_s);
  if (!time_s) return;
  setpoint_ = Reading{*time_s, arrival_s, message.positions, {}, q_of(message, *places)};
  const bool goes_on = phase_ != Phase::idle || continues_;
  if (goes_on && message.names == names_ && is_ours(*setpoint_) && !goes_back(*setpoint_)) {
    pass_wrist_through();
  } else if (goes_on && config_.motion_enabled) {
    on_foreign_command(arrival_s);
  } else if (phase_ == Phase::idle) {
    names_ = message.names, places_ = *places;
    continues_ = false;
  }
  watch_rest(arrival_s);
  watch(arrival_s);
}

void Interlock::on_operating_state(const OperatingStateMessage& message, double arrival_s) {
  // Another program's state may be this arm's, too: the one before does not count then.
  if (!is_of(state_sender_, message.source, arrival_s)) return operating_state_.reset();
  const bool changed = operating_state_ && operating_state_->state != message.state;
  const bool is_fault = message.state == to_string(OperatingState::fault);
  if (changed || !is_fault) fault_s_ = is_fault ? std::optional(arrival_s) : std::nullopt;
  operating_state_ = message;
  watch(arrival_s);
}

void Interlock::on_error(const TextMessage& message, double arrival_s) {
  constexpr std::size_t longest = 120;
  if (message.latched == Latched::again) return;
  error_ = {printable(message.text, longest), message.source};
  error_s_ = arrival_s;
}

void Interlock::on_foreign_command(double arrival_s) {
  if (!config_.motion_enabled) return;
  foreign_s_ = arrival_s;
  watch(arrival_s);
}

// The arm may be late, round, and go straight from where it is to the next setpoint that it gets.
std::optional<Interlock::Interval> Interlock::when_sent(const Reading& setpoint, double near) const {
  std::optional<Interval> when;
  for (std::size_t i = 0; i < sent_.size(); ++i) {
    const Sent &from = sent_[i], &to = sent_[std::min(i + 1, sent_.size() - 1)];
    if (setpoint.time_s - to.time_s > memory_s || !lies_between(setpoint.q, from.q, to.q, near)) continue;
    when = Interval{when ? when->begin_s : from.time_s, to.time_s};
  }
  return when;
}

bool Interlock::is_ours(const Reading& setpoint) const {
  bool ours = lies_between(setpoint.q, last_, last_) || when_sent(setpoint, 1);
  for (std::size_t i = 0; i < others_.size() && ours; ++i)
    ours = std::find(places_.begin(), places_.end(), i) != places_.end() || is_wrist(i) ||
           std::abs(setpoint.positions[i] - others_[i]) <= same_other;
  return ours;
}

// Late as it may be, an arm does not go back on our path unless another program's commands alternate with ours, as in
// teleoperation, which begins where the arm is.
bool Interlock::goes_back(const Reading& setpoint) {
  constexpr double exactly = 0.1;  // of an arm that rounds more nothing is known
  const auto when = when_sent(setpoint, exactly);
  if (!when) return false;
  if (when->end_s < passed_s_) return true;
  passed_s_ = std::max(passed_s_, when->begin_s);
  return false;
}

bool Interlock::is_wrist(std::size_t place) const {
  return std::any_of(config_.wrist.begin(), config_.wrist.end(),
                     [&](const std::string& name) { return is_same_joint(name, names_[place]); });
}

// The arm's rounding is not sent back, lest it creep; where somebody moves the wrist it follows at once.
void Interlock::pass_wrist_through() {
  const std::vector<double>& now = setpoint_->positions;
  for (std::size_t i = 0; i < others_.size(); ++i)
    if (is_wrist(i) && std::abs(now[i] - others_[i]) > same_other) wrist_moved_s_ = setpoint_->time_s;
  if (!wrist_moved_s_ || setpoint_->time_s - *wrist_moved_s_ > rest_s) return;
  for (std::size_t i = 0; i < others_.size(); ++i)
    if (is_wrist(i)) others_[i] = now[i];
}

// Somebody may move the arm in its own program, which publishes no command then.
void Interlock::watch_rest(double now_s) {
  const auto is_new = [&](const std::optional<Reading>& one) {
    return one && now_s - one->arrival_s < config_.max_age_s;
  };
  if (!is_new(measured_) || !is_new(setpoint_)) return rest_.reset();
  // Where we sent it last, it still goes, however late it hears of that.
  const double since_s = sent_.empty() ? memory_s : now_s - sent_.back().time_s;
  if (phase_ != Phase::idle || since_s < (continues_ ? memory_s : settling_s)) return rest_.reset();
  const auto left = [](const Eigen::Vector4d& now, const Eigen::Vector4d& then) {
    return ((now - then).array().abs() > same_q.array()).any();
  };
  const bool moved = rest_ && (left(measured_->q, rest_->measured) || left(setpoint_->q, rest_->setpoint));
  if (moved) moved_s_ = now_s;
  if (!rest_ || moved || now_s - rest_->since_s > rest_s) rest_ = Rest{now_s, measured_->q, setpoint_->q};
}

void Interlock::follow(const JointPath& path) {
  if (untold_ != Blocked::none) return;
  path_ = path;
  released_ = false;
  followed_s_.reset();
}

Blocked Interlock::blocked(double now_s) const {
  if (foreign_s_ && now_s - *foreign_s_ <= config_.max_age_s) return Blocked::foreign_command;
  if (measured_sender_.has_rival(now_s) || setpoint_sender_.has_rival(now_s) || state_sender_.has_rival(now_s))
    return Blocked::second_source;
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
  if (phase_ != Phase::idle) return Blocked::none;
  if (config_.motion_enabled && moved_s_ && now_s - *moved_s_ < rest_s) return Blocked::moving;
  const Eigen::Array4d distance = (setpoint_->q - measured_->q).array().abs();
  return (distance > config_.max_distance.array()).any() ? Blocked::far_from_setpoint : Blocked::none;
}

void Interlock::watch(double now_s) {
  const Blocked why = blocked(now_s);
  if (phase_ == Phase::following && is_silence(why) && !silent_since_s_) silent_since_s_ = now_s, ++counts_.pauses;
  if (!is_silence(why) && silent_since_s_) {
    counts_.longest_pause_s = std::max(counts_.longest_pause_s, now_s - *silent_since_s_ + config_.max_age_s);
    silent_since_s_.reset();
  }
  if (why == Blocked::none) return;
  if (untold_ == Blocked::none || is_silence(untold_)) untold_ = why;
  blocked_s_ = now_s;
  stop(why);
}

void Interlock::stop(Blocked why) {
  path_.reset();
  continues_ = is_silence(why) && (continues_ || phase_ != Phase::idle);
  if (phase_ != Phase::idle) phase_ = obeys(why) ? Phase::braking : Phase::idle;
}

JointState Interlock::state(double now_s) {
  watch(now_s);
  JointState state = latest(now_s);
  state.blocked = std::exchange(untold_, Blocked::none);
  return state;
}

JointState Interlock::latest(double now_s) const {
  JointState state;
  state.follows = config_.motion_enabled;
  state.blocked = blocked(now_s);
  if (measured_) state.time_s = measured_->time_s, state.q = JointVector::from_vector(measured_->q);
  if (measured_) state.wrist_rad = measured_->wrist_rad;
  if (!operating_state_) return state;
  state.operating_state = operating_state_from_string(operating_state_->state).value_or(OperatingState::disabled);
  state.other_state = other_state();
  return state;
}

// An arm says what is wrong, then that its state is FAULT, on topics that do not wait for each other.
std::string Interlock::other_state() const {
  constexpr double before_s = 1;
  const std::string& state = operating_state_->state;
  if (!operating_state_from_string(state)) return printable(state);
  const bool explains = fault_s_ && error_s_ >= *fault_s_ - before_s && error_.source == operating_state_->source;
  return explains && !error_.text.empty() ? fmt::format("{} ({})", state, error_.text) : "";
}

void Interlock::start(double now_s) {
  if (phase_ == Phase::idle && !continues_) {
    last_ = setpoint_->q;
    velocity_.setZero();
    others_ = setpoint_->positions;
    sent_.push_back({now_s, last_});
    passed_s_ = 0;
  }
  shift_ = last_ - path_->at(now_s).position;
  phase_ = Phase::following;
  continues_ = false;
}

Eigen::Vector4d Interlock::within_limits(const Eigen::Vector4d& wanted) const {
  return wanted.cwiseMax(config_.limits.lower.cwiseMin(last_)).cwiseMin(config_.limits.upper.cwiseMax(last_));
}

std::vector<double> Interlock::with_the_four(std::vector<double> joints, const Eigen::Vector4d& four) const {
  for (int i = 0; i < 4; ++i) joints[places_[i]] = four[i];
  return joints;
}

std::vector<double> Interlock::velocities() const {
  const Eigen::Vector4d at_rest = Eigen::Vector4d::Zero();
  return with_the_four(std::vector<double>(others_.size()),
                       joints_from_q(config_.joints, velocity_) - joints_from_q(config_.joints, at_rest));
}

// The velocity over the coming period of a joint that is `away` from its path: at rest exactly onto it, else with the
// path and nearer to it.
double Interlock::next_velocity(Eigen::Index joint, double away, double path_velocity) const {
  const double rate = config_.limits.rate[joint], change = config_.limits.acceleration[joint] * config_.period_s;
  const double exact = away / config_.period_s, before = velocity_[joint];
  if (path_velocity == 0 && std::abs(exact) <= change && std::abs(exact - before) <= change) return exact;
  const double behind = away - path_velocity * config_.period_s;
  const double closing = approach_speed(std::abs(behind), config_.limits.acceleration[joint]);
  const JointLimits& limits = config_.limits;
  const double up = approach_speed(std::max(0.0, limits.upper[joint] - last_[joint]), limits.acceleration[joint]);
  const double down = approach_speed(std::max(0.0, last_[joint] - limits.lower[joint]), limits.acceleration[joint]);
  const double wanted =
      std::clamp(path_velocity + std::copysign(closing, behind), -std::min(rate, down), std::min(rate, up));
  return std::clamp(wanted, before - change, before + change);
}

// Where it is to be this period, as far as the limits allow; true when it rests there.
bool Interlock::approach(const MotionState& wanted) {
  const Eigen::Vector4d position = wanted.position + shift_, within = within_limits(position);
  for (Eigen::Index i = 0; i < 4; ++i)
    velocity_[i] = next_velocity(i, within[i] - last_[i], within[i] == position[i] ? wanted.velocity[i] : 0);
  const Eigen::Vector4d reached = within_limits(last_ + config_.period_s * velocity_);
  velocity_ = (reached - last_) / config_.period_s;
  last_ = reached;
  return wanted.velocity.isZero() && (last_ - within).cwiseAbs().maxCoeff() < 1e-12;
}

std::optional<std::vector<double>> Interlock::send(double now_s) {
  if (!last_.allFinite()) {
    untold_ = Blocked::non_finite_joints;
    blocked_s_ = now_s;
    path_.reset();
    phase_ = Phase::idle;
    return std::nullopt;
  }
  sent_.push_back({now_s, last_});
  while (now_s - sent_.front().time_s > memory_s + config_.max_age_s) sent_.pop_front();
  ++(config_.motion_enabled ? counts_.set_points : counts_.withheld);
  return config_.motion_enabled ? std::optional(with_the_four(others_, joints_from_q(config_.joints, last_)))
                                : std::nullopt;
}

void Interlock::give_up(Blocked why, double now_s) {
  untold_ = why;
  blocked_s_ = now_s;
  stop(why);
}

// After a pause the arm may not have what was sent last: from where it is, the next setpoint would be a step.
bool Interlock::is_lost_on_its_way(double now_s) {
  if (phase_ != Phase::idle || !continues_ || lies_between(setpoint_->q, last_, last_)) return false;
  if (now_s - sent_.back().time_s > lost_s) give_up(Blocked::displaced, now_s);
  return true;
}

std::optional<std::vector<double>> Interlock::tick(double now_s) {
  // An arm that nobody watched may be elsewhere: it is not even braked.
  if (now_s - std::exchange(ticked_s_, now_s).value_or(now_s) > unwatched_s) on_suspended(now_s);
  watch(now_s);
  if (path_ && !path_->at(now_s).position.allFinite()) stop(Blocked::non_finite_joints);
  if (phase_ == Phase::braking && !path_) {
    // Each joint by itself: so all rest within the limits that they approach.
    const Eigen::Vector4d change = config_.period_s * config_.limits.acceleration;
    velocity_ -= velocity_.cwiseMin(change).cwiseMax(-change);
    last_ += config_.period_s * velocity_;
    if (velocity_.isZero()) phase_ = Phase::idle;
    return send(now_s);
  }
  if (!path_ || is_lost_on_its_way(now_s)) return std::nullopt;
  // While the arm could not be moved by us it may have been by others.
  if (phase_ == Phase::idle && !(setpoint_->arrival_s > blocked_s_)) return std::nullopt;
  if (phase_ != Phase::following) start(now_s);
  if (!followed_s_) followed_s_ = now_s;
  if (now_s - *followed_s_ > unwatched_s) released_ = true;
  const MotionState motion = path_->at(now_s);
  const bool rests = approach(motion);
  if (rests) velocity_.setZero();
  auto sent = send(now_s);
  if (released_ && rests) path_.reset(), phase_ = Phase::idle;
  return sent;
}

}  // namespace lapservo::internal
