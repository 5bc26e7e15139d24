#include "lapservo/crtk/crtk_robot.h"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/printable.h"
#include "lapservo/robot/real_time.h"
#include "lapservo/robot/suspension_watch.h"

namespace lapservo::internal {
namespace {

constexpr int setpoint_priority = 20;

using Commands = std::map<CommandType, std::vector<const char*>>;

// Topics of CRTK and dVRK that move an arm or change its efforts, in its namespace, by what they carry. servo_js is
// that of the dVRK after 2.4.
const Commands motion_commands{
    {CommandType::joints,
     {"servo_jp", "servo_jr", "servo_jv", "servo_jf", "pid_feed_forward/servo_jf", "move_jp", "move_jr"}},
    {CommandType::joint_servo, {"servo_js"}},
    {CommandType::pose, {"servo_cp", "servo_cr", "move_cp", "move_cr"}},
    {CommandType::twist, {"servo_cv"}},
    {CommandType::wrench, {"servo_cf", "body/servo_cf", "spatial/servo_cf"}},
    {CommandType::cartesian_state, {"servo_cs"}},
    {CommandType::impedance, {"servo_ci"}},
    {CommandType::on_or_off, {"use_gravity_compensation"}},
    {CommandType::nothing, {"hold", "free"}}};

// Those past the arm, which dVRK 2.4 has with `dvrk_system --pid-topics-read-write`, in PID/ beside the arm.
const Commands pid_commands{{CommandType::joints, {"servo_jp", "servo_jf", "feed_forward/servo_jf"}},
                            {CommandType::on_or_off, {"enable"}}};

std::string pid_of(const std::string& arm) {
  const std::size_t slash = arm.rfind('/');
  const std::size_t name = slash == std::string::npos ? 0 : slash + 1;
  return arm.substr(0, name) + "PID/" + arm.substr(name);
}

}  // namespace

std::string topic_of(const std::string& arm, const std::string& name) {
  return (arm.rfind('/', 0) == 0 ? "" : "/") + arm + "/" + name;
}

std::string instrument_of(const std::string& arm) {
  constexpr std::string_view simulated = "SIM_";
  const std::string name = arm.substr(arm.rfind('/') + 1);
  return name.starts_with(simulated) ? name.substr(simulated.size()) : name;
}

CrtkRobot::CrtkRobot(Transport& transport, const std::string& arm, const InterlockConfig& config, const Clock& clock)
    : clock_(clock),
      period_s_(config.period_s),
      arm_(arm),
      max_readers_(config.max_readers),
      transport_(transport),
      interlock_(config) {
  // Who only observes is no publisher either: others may watch for those.
  if (config.motion_enabled) servo_jp_ = transport.set_point_publisher(topic_of(arm, "servo_jp"));
  const auto hear = [&]<typename Message>(const char* topic, void (Interlock::*tell)(const Message&, double)) {
    subscriptions_.push_back(transport.subscribe<Message>(topic_of(arm, topic), [this, tell](Message&& message) {
      const double arrival_s = clock_.now_s();
      std::unique_lock lock(mutex_);
      (interlock_.*tell)(message, arrival_s);
      const std::string complaint = new_complaint();
      lock.unlock();  // stderr may block, and command() needs the interlock
      if (!complaint.empty()) std::fprintf(stderr, "lapservo: %s: %s\n", arm_.c_str(), complaint.c_str());
    }));
  };
  hear("measured_js", &Interlock::on_measured);
  hear("setpoint_js", &Interlock::on_setpoint);
  hear("operating_state", &Interlock::on_operating_state);
  hear("error", &Interlock::on_error);
  const auto watch = [&](const std::string& of, const Commands& commands) {
    for (const auto& [type, names] : commands)
      for (const char* name : names)
        subscriptions_.push_back(transport.subscribe_commands(topic_of(of, name), type, [this](CommandMessage&&) {
          const double arrival_s = clock_.now_s();
          const std::lock_guard lock(mutex_);
          interlock_.on_foreign_command(arrival_s);
        }));
  };
  if (config.motion_enabled) watch(arm, motion_commands), watch(pid_of(arm), pid_commands);
  thread_ = std::thread([this] { command(); });
}

CrtkRobot::~CrtkRobot() {
  ended_ = true;
  thread_.join();
  subscriptions_.clear();
}

// An arm of the same name that publishes no states would follow, too.
void CrtkRobot::look_at_readers() {
  const std::string topic = topic_of(arm_, "servo_jp");
  auto readers = transport_.readers(topic);
  if (readers.size() > max_readers_ && readers != readers_)
    std::fprintf(stderr, "lapservo: %s is read by %s, expected %zu\n", topic.c_str(), printable_names(readers).c_str(),
                 max_readers_);
  readers_ = std::move(readers);
  const std::lock_guard lock(mutex_);
  interlock_.on_readers(readers_.size());
}

JointState CrtkRobot::state() {
  if (servo_jp_) look_at_readers();
  const std::lock_guard lock(mutex_);
  return interlock_.state(clock_.now_s());
}

JointState CrtkRobot::latest() const {
  const std::lock_guard lock(mutex_);
  return interlock_.latest(clock_.now_s());
}

std::vector<JointReading> CrtkRobot::latest_readings() const {
  const std::lock_guard lock(mutex_);
  return interlock_.latest_readings();
}

std::vector<JointReading> CrtkRobot::readings() {
  const std::lock_guard lock(mutex_);
  return interlock_.take_readings();
}

void CrtkRobot::send(const JointPath& path) {
  const std::lock_guard lock(mutex_);
  interlock_.follow(path);
}

void CrtkRobot::release() {
  const std::lock_guard lock(mutex_);
  interlock_.release();
}

InterlockCounts CrtkRobot::counts() const {
  const std::lock_guard lock(mutex_);
  return interlock_.counts();
}

std::string CrtkRobot::not_granted() const {
  const std::lock_guard lock(mutex_);
  return not_granted_;
}

std::optional<Eigen::Vector4d> CrtkRobot::set_point() const {
  const std::lock_guard lock(mutex_);
  return interlock_.set_point();
}

std::string CrtkRobot::new_complaint() {
  if (interlock_.complaint() == said_) return {};
  said_ = interlock_.complaint();
  return said_;
}

void CrtkRobot::command() {
  {
    std::string refused = request_real_time(setpoint_priority);
    const std::lock_guard lock(mutex_);
    not_granted_ = std::move(refused);
  }
  const auto period =
      std::chrono::duration_cast<std::chrono::steady_clock::duration>(std::chrono::duration<double>(period_s_));
  auto next = std::chrono::steady_clock::now();
  SuspensionWatch suspension(clock_);
  while (!ended_) {
    JointMessage message;
    {
      const std::lock_guard lock(mutex_);
      if (suspension.was_suspended()) interlock_.on_suspended(clock_.now_s());
      if (auto positions = interlock_.tick(clock_.now_s())) {
        message.names = interlock_.names();
        message.positions = std::move(*positions);
        message.velocities = interlock_.velocities();
      }
    }
    if (!message.positions.empty()) {
      message.stamp_s = transport_.stamp_now_s();
      servo_jp_(message);
    }
    // Missed setpoints are dropped: a burst of setpoints would pass the rate limit.
    next = std::max(next + period, std::chrono::steady_clock::now());
    std::this_thread::sleep_until(next);
  }
}

}  // namespace lapservo::internal
