#include "lapservo/loop_topics/loop_topics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/core/lower_case.h"
#include "lapservo/core/printable.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/io/overlay.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/robot/supervisor_state.h"

namespace lapservo::internal {
namespace {

constexpr double between_states_s = 1, between_drawings_s = 0.1;
// A start is repeated when one came so long before: `ros2 topic pub` says it once a second, about.
// Messages that a network or a stopped process kept back are usually late by no more.
constexpr double repeated_s = 1.5;
constexpr std::size_t most_remarks = 3;  // a tick
constexpr double never = -std::numeric_limits<double>::infinity();
constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

std::vector<std::string> feature_names() {
  return {FeatureVector::names.begin(), FeatureVector::names.end()};
}

template <std::size_t N, typename Matrix>
std::array<double, N> rows_of(const Matrix& matrix) {
  std::array<double, N> values{};
  auto to = values.begin();
  for (const auto& row : matrix.rowwise()) to = std::copy(row.begin(), row.end(), to);
  return values;
}

// Lower case, one blank between words.
std::string plain_words(const std::string& text) {
  std::istringstream words(lower_case(text));
  std::string plain;
  for (std::string word; words >> word;) plain += (plain.empty() ? "" : " ") + word;
  return plain;
}

std::string topic(const Rig& rig, const std::string& name) {
  return "/lapservo/" + rig.instruments.front().name + "/" + name;
}

// Throws InputError for what makes no sense.
Eigen::Vector4d features_of(const JointMessage& message, const std::string&) {
  if (message.names != feature_names() || message.positions.size() != FeatureVector::size ||
      !all_finite(message.positions))
    throw InputError("set_point", "expected four finite positions named s_rad, r_px, l_px, d_px");
  return Eigen::Vector4d(message.positions.data());
}

// Throws InputError where a goal of the tip is in another frame than the camera's. One without a name is in the
// camera's; names of tf's first version begin with a slash.
void refuse_other_frame(const char* goal, const std::string& frame, const std::string& camera) {
  const auto bare = [](std::string_view name) { return name.substr(name.starts_with('/') ? 1 : 0); };
  if (!frame.empty() && bare(frame) != bare(camera))
    throw InputError(goal, "header.frame_id", printable(frame),
                     camera + ", the camera's frame, or none: transform the goal into that frame");
}

// Throws InputError for what makes no sense, and for one of more than an hour or ten thousand points, which takes too
// long to check.
Trajectory trajectory_of(const TrajectoryMessage& message, const std::string& camera) {
  constexpr double longest_s = 3600;
  constexpr std::size_t most = 10000;
  const std::vector<std::string> places{"x_m", "y_m", "z_m"}, turned_places{"x_m", "y_m", "z_m", "roll_rad"};
  const bool turns = message.names == turned_places, of_tip = turns || message.names == places;
  if (!of_tip && message.names != feature_names())
    throw InputError("trajectory", "expected the names s_rad, r_px, l_px, d_px, or x_m, y_m, z_m with roll_rad or not");
  if (message.points.empty() || message.points.size() > most || !(message.points.back().time_s <= longest_s))
    throw InputError("trajectory", fmt::format("expected 2 to {} points between 0 and {} s", most, longest_s));
  if (of_tip) refuse_other_frame("trajectory", message.frame, camera);
  std::vector<double> times_s;
  std::vector<Eigen::Vector4d> features;
  std::vector<TipGoal> tips;
  for (const TrajectoryMessage::Point& point : message.points) {
    const std::vector<double>& values = point.positions;
    if (values.size() != message.names.size())
      throw InputError("trajectory", fmt::format("a point has {} positions, expected one for each of {} names",
                                                 values.size(), message.names.size()));
    times_s.push_back(point.time_s);
    if (of_tip) {
      tips.push_back({Eigen::Vector3d(values.data()), turns ? std::optional(values[3]) : std::nullopt});
    } else {
      features.emplace_back(values.data());
    }
  }
  return of_tip ? tip_trajectory_through(std::move(times_s), tips, "trajectory")
                : trajectory_through(std::move(times_s), std::move(features), "trajectory");
}

// Throws InputError for what is no pose in the camera's frame.
TipGoal tip_goal_of(const PlaceMessage& message, const std::string& camera) {
  constexpr double rounding = 1e-3;
  refuse_other_frame("tip_goal", message.frame, camera);
  const Eigen::Quaterniond& turn = message.pose.rotation;
  TipGoal goal{message.pose.translation};
  // ROS 2 and ROS 1 write these where nobody sets it.
  const bool unset = turn.coeffs() == Eigen::Vector4d(0, 0, 0, 1) || turn.coeffs() == Eigen::Vector4d(0, 0, 0, 0);
  if (!unset) {
    if (!(std::abs(turn.norm() - 1) < rounding))
      throw InputError("tip_goal", "orientation", fmt::format("of norm {}", turn.norm()), "a unit quaternion");
    goal.camera_from_tip = turn.normalized();
  }
  tip_set_point(goal, "tip_goal");
  return goal;
}

}  // namespace

LoopTopics::LoopTopics(Transport& transport, const Rig& rig, const FrameNames& frames, bool hears)
    : transport_(transport),
      rig_(rig),
      interrupted_s_(never),
      observation_(transport.publisher<ObservationMessage>(topic(rig, "observation"))),
      frames_(transport, first_instrument(rig, "rig"), frames, true),
      desired_(transport.publisher<JointMessage>(topic(rig, "desired"))),
      error_(transport.publisher<JointMessage>(topic(rig, "error"))),
      diagnostics_(transport.publisher<DiagnosticMessage>("/diagnostics")),
      overlay_(transport.publisher<CompressedImageMessage>(topic(rig, "overlay/compressed"))),
      begun_s_(-never),
      started_s_{never, never},
      other_loop_s_(never) {
  subscriptions_.push_back(transport.subscribe<JointMessage>(topic(rig, "desired"), [this](JointMessage&&) {
    const std::lock_guard lock(mutex_);
    other_loop_s_ = SteadyClock().now_s();
  }));
  if (hears) hear_wishes();
  thread_ = std::thread([this] { draw(); });
}

void LoopTopics::hear_wishes() {
  subscriptions_.push_back(
      transport_.subscribe<StringMessage>(topic(rig_, "command"), [this](StringMessage&& command) { hear(command); }));
  hear_goals("set_point", features_of, &LoopWishes::set_point);
  hear_goals("tip_goal", tip_goal_of, &LoopWishes::tip_goal);
  hear_goals("trajectory", trajectory_of, &LoopWishes::trajectory);
}

LoopTopics::~LoopTopics() {
  subscriptions_.clear();
  to_draw_.cancel();
  thread_.join();
}

void LoopTopics::publish(const ControlTick& tick, const std::string& state) {
  const double stamp_s = transport_.stamp_now_s();
  publish_numbers(tick, stamp_s);
  publish_state(tick, state, stamp_s);
  if (!tick.seen) return;
  // The image's time, on the clock of those who listen.
  const double seen_s = stamp_s - (tick.input.time_s - tick.seen->image.time_s);
  publish_observation(tick, seen_s);
  if (tick.input.time_s < next_drawing_s_) return;
  next_drawing_s_ = tick.input.time_s + between_drawings_s;
  to_draw_.push_over_oldest(
      {seen_s, tick.seen->image.bgr, {tick.seen->observations.front()}, tick.seen->camera_from_rcm});
}

void LoopTopics::publish_numbers(const ControlTick& tick, double stamp_s) {
  const auto say = [&](const auto& publisher, const Eigen::Vector4d& f) {
    publisher(JointMessage{stamp_s, feature_names(), {f.data(), f.data() + 4}});
  };
  if (tick.input.desired.features.allFinite()) say(desired_, tick.input.desired.features);
  if (tick.decision.control.estimate) say(error_, tick.decision.control.error);
}

void LoopTopics::publish_observation(const ControlTick& tick, double stamp_s) {
  const Observation& seen = tick.seen->observations.front();
  const ImageMeasurement& measured = tick.seen->measurement;
  const Instrument& instrument = rig_.instruments.front();
  const auto& camera_from_rcm = tick.seen->camera_from_rcm;
  const bool current = measured.registration == tick.decision.registration;
  ObservationMessage message;
  message.stamp_s = stamp_s;
  message.frame = frames_.camera();
  message.instrument = instrument.name;
  message.status = to_string(seen.status);
  message.action = to_string(tick.decision.control.action);
  message.reason = to_string(tick.decision.control.reason);
  for (auto* values : {&message.q, &message.features, &message.error}) values->fill(unknown);
  for (auto* values : {&message.q_covariance, &message.feature_covariance}) values->fill(unknown);
  message.edges_px.fill(unknown);
  if (tick.decision.control.estimate) message.error = rows_of<4>(tick.decision.control.error);
  if (measured.found && current) {
    message.features = rows_of<4>(measured.features);
    message.feature_covariance = rows_of<16>(measured.covariance);
  }
  if (seen.status == Status::ok)
    for (std::size_t i = 0; i < 4; ++i)
      message.edges_px[2 * i] = seen.edges_raw_px[i].x(), message.edges_px[2 * i + 1] = seen.edges_raw_px[i].y();
  if (seen.status == Status::ok && seen.rcm && camera_from_rcm && current) {
    message.q = rows_of<4>(seen.rcm->q.vector());
    message.q_covariance = rows_of<16>(seen.rcm->covariance);
  }
  frames_.publish(0, seen, current ? camera_from_rcm : std::nullopt, stamp_s);
  observation_(message);
}

void LoopTopics::publish_state(const ControlTick& tick, const std::string& state, double stamp_s) {
  if (state == last_state_ && tick.input.time_s < next_state_s_) return;
  last_state_ = state;
  next_state_s_ = tick.input.time_s + between_states_s;
  DiagnosticMessage message;
  message.stamp_s = stamp_s;
  message.level = state.empty() ? DiagnosticMessage::Level::ok : DiagnosticMessage::Level::warning;
  message.name = "lapservo: " + rig_.instruments.front().name;
  const ControlStep& control = tick.decision.control;
  message.message = state.empty() ? std::string(to_string(control.action)) : state;
  message.values = {{"action", std::string(to_string(control.action))},
                    {"reason", std::string(to_string(control.reason))},
                    {"limited", control.limited ? "true" : "false"},
                    {"delay_s", fmt::format("{:.4f}", control.delay_s)},
                    {"registration", std::to_string(tick.decision.registration)}};
  for (std::size_t i = 0; control.estimate && i < FeatureVector::size; ++i)
    message.values.emplace_back(fmt::format("error_{}", FeatureVector::names[i]),
                                fmt::format("{:.6g}", control.error[static_cast<Eigen::Index>(i)]));
  diagnostics_(message);
}

void LoopTopics::hear(const StringMessage& command) {
  const std::string words = plain_words(command.text);
  const std::lock_guard lock(mutex_);
  const bool starts = words == "start" || words == "start force";
  if (starts && is_of_before(command.latched)) return;
  if (starts) return hear_start(command, words != "start");
  wishes_.stops.insert(command.source);
  if (words == "stop") return;
  remark(
      fmt::format("stopped by the unknown command '{}': expected start, start force or stop", printable(command.text)));
}

void LoopTopics::remark(const std::string& text) {
  if (wishes_.remarks.size() < most_remarks) wishes_.remarks.insert(text);
}

bool LoopTopics::is_of_before(Latched latched) {
  const bool begins = !(clock_.now_s() - begun_s_ > repeated_s);
  if (latched != Latched::again && (latched == Latched::no || !begins)) return false;
  remark(
      "a latched start or goal does not count where the loop has just begun or its sender connects again: say it "
      "again");
  return true;
}

// The last of all goals counts.
template <typename Message, typename Goal>
void LoopTopics::hear_goals(const char* name, Goal (*goal_of)(const Message&, const std::string& camera),
                            std::optional<Goal> LoopWishes::*wish) {
  const auto hear_goal = [this, goal_of, wish](Message&& message) {
    std::optional<Goal> goal;
    std::string refusal;
    try {
      goal = goal_of(message, frames_.camera());
    } catch (const InputError& error) {
      refusal = std::string("refused: ") + error.what();
    }
    const std::lock_guard lock(mutex_);
    if (!goal) return remark(refusal);
    if (is_of_before(message.latched)) return;
    wishes_.set_point.reset(), wishes_.tip_goal.reset(), wishes_.trajectory.reset();
    wishes_.*wish = std::move(goal);
  };
  subscriptions_.push_back(transport_.subscribe<Message>(topic(rig_, name), hear_goal));
}

void LoopTopics::hear_start(const StringMessage& command, bool force) {
  const double now_s = SteadyClock().now_s();
  const double before_s = std::exchange(started_s_.at(force ? 1 : 0), now_s);
  if (now_s - before_s > repeated_s) {
    wishes_.starts.push_back({now_s, force, command.source});
  } else {
    wishes_.remarks.emplace("a start that is repeated does not count: say it once (ros2 topic pub --once)");
  }
}

bool LoopTopics::name_is_in_use() const {
  constexpr double lasts_s = 1;
  const std::lock_guard lock(mutex_);
  return SteadyClock().now_s() - other_loop_s_ < lasts_s;
}

bool LoopTopics::may_be_old(double arm_heard_s) {
  const double now_s = clock_.now_s();
  const double heard_s = std::min(arm_heard_s, std::exchange(called_s_, now_s).value_or(now_s));
  if (suspension_.was_suspended() || now_s - heard_s > SupervisorConfig().max_silence_s) interrupted_s_ = now_s;
  return now_s - interrupted_s_ <= repeated_s;
}

LoopWishes LoopTopics::wishes(double arm_heard_s) {
  const bool old = may_be_old(arm_heard_s);
  const std::lock_guard lock(mutex_);
  begun_s_ = std::min(begun_s_, clock_.now_s());
  LoopWishes said = std::exchange(wishes_, {});
  if (!old || (said.starts.empty() && !said.set_point && !said.tip_goal && !said.trajectory)) return said;
  LoopWishes rest;
  rest.stops = std::move(said.stops), rest.remarks = std::move(said.remarks);
  rest.remarks.insert(fmt::format(
      "a start or goal does not count until {} s after a silence of the arm or a standstill of the loop, since it may "
      "have been said before: say it again",
      repeated_s));
  return rest;
}

void LoopTopics::draw() {
  while (const auto drawing = to_draw_.pop()) {
    CompressedImageMessage message;
    message.stamp_s = drawing->stamp_s;
    message.frame = frames_.camera();
    message.format = "bgr8; jpeg compressed bgr8";
    Rig rig = rig_;
    rig.instruments.front().camera_from_rcm = drawing->camera_from_rcm;
    constexpr int quality = 80;
    message.data = encode_jpeg(draw_overlay(drawing->bgr, rig, drawing->observations), quality);
    overlay_(message);
  }
}

}  // namespace lapservo::internal
