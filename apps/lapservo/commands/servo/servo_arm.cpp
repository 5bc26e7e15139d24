#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/commands/servo/changing_goal.h"
#include "apps/lapservo/commands/servo/run_watcher.h"
#include "apps/lapservo/commands/servo/servo_options.h"
#include "apps/lapservo/inputs/live_images.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/arm_pose.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/crtk/operator_presence.h"
#include "lapservo/loop_topics/loop_topics.h"
#include "lapservo/robot/real_time.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/robot/supervisor.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr double wait_s = 15;      // for the arm and the camera to be heard
constexpr int loop_priority = 10;  // below the setpoints'

std::string list_of(const Joints& joints, const Eigen::Vector4d& q) {
  const Eigen::Vector4d positions = joints_from_q(joints, q);
  std::string text;
  for (int i = 0; i < 4; ++i) text += fmt::format("{}{} {:.4f}", i ? ", " : "", joints.names[i], positions[i]);
  return text;
}

std::string name_in_use(const Rig& rig) {
  return fmt::format("another loop runs as {}: end it, or give this rig's instrument another name",
                     rig.instruments.front().name);
}

// Every change is reported once, in one line.
class ArmWatcher : public RunWatcher {
 public:
  ArmWatcher(const ServoOptions& options, RunFolder& folder, Supervisor& arm, ServoPage* page, const RunConfig& run,
             const CrtkRobot& robot, const ArmPose* endoscope, LiveImages& images, LoopTopics& topics,
             ChangingGoal& goal)
      : RunWatcher(options, folder, &arm, page),
        run_(run),
        arm_(arm),
        robot_(robot),
        endoscope_(endoscope),
        images_(images),
        topics_(topics),
        goal_(goal) {}

 private:
  bool follow(const ControlTick& tick, double time_s) override {
    if (const auto& motions = summary().endoscope_motions(); motions.size() > said_motions_) {
      say(time_s, motions.back());
      said_motions_ = motions.size();
    }
    if (is_new_state()) say(time_s, state());
    say_images(time_s);
    const bool two_endoscopes = endoscope_ && endoscope_->has_two_senders();
    if (!std::exchange(two_endoscopes_, two_endoscopes) && two_endoscopes)
      say(time_s, options_.endoscope + ": two programs publish its pose, so it is not known: end one of them");
    topics_.publish(tick, state() == to_string(ControlAction::track) ? "" : state());
    obey(topics_.wishes(tick.input.joints.time_s), tick, time_s);
    if (!options_.enable_motion) say_what_would_be_sent(time_s);
    if (topics_.name_is_in_use()) {
      say(time_s, "end: " + name_in_use(run_.rig));
      return false;
    }
    return true;
  }
  void obey(const LoopWishes& wishes, const ControlTick& tick, double time_s) {
    for (const std::uint64_t source : wishes.stops) arm_.stop({Commander::topic, source});
    for (const LoopWishes::Start& start : wishes.starts)
      arm_.start({Commander::topic, start.source}, start.said_s, start.force);
    constexpr std::size_t most_said = 100;
    constexpr double silent_s = 10;  // about what is repeated
    for (const std::string& remark : wishes.remarks) {
      if (next_remarks_s_.size() >= most_said && !next_remarks_s_.contains(remark)) continue;
      double& next_s = next_remarks_s_[remark];
      if (time_s >= next_s) say(time_s, remark), next_s = time_s + silent_s;
    }
    if (wishes.set_point) goal_.want("set_point", 1, set_point(*wishes.set_point));
    if (wishes.tip_goal) goal_.want("tip_goal", 0, tip_set_point(*wishes.tip_goal, "tip_goal"));
    if (wishes.trajectory) goal_.want("trajectory", wishes.trajectory->duration_s, *wishes.trajectory);
    follow_goal(goal_, tick, time_s);
  }
  void say_images(double time_s) {
    if (const auto ended = images_.ended(); ended && !said_ended_) {
      said_ended_ = true;
      say(time_s, options_.camera + ": " + (ended->empty() ? "its images have ended" : *ended));
    }
    const std::string counts = images_.counts().text();
    if (counts == said_counts_ || time_s < next_counts_s_) return;
    said_counts_ = counts;
    next_counts_s_ = time_s + 1;
    say(time_s, "images: " + counts + (images_.complaint().empty() ? "" : " (last: " + images_.complaint() + ")"));
  }
  void say_what_would_be_sent(double time_s) {
    const auto set_point = robot_.set_point();
    if (!set_point || time_s < next_set_point_s_) return;
    next_set_point_s_ = time_s + 1;
    say(time_s, "would send " + list_of(*run_.rig.instruments.front().joints, *set_point) + " (--enable-motion does)");
  }

  const RunConfig& run_;
  Supervisor& arm_;
  const CrtkRobot& robot_;
  const ArmPose* endoscope_;  // its arm, where it moves
  LiveImages& images_;
  LoopTopics& topics_;
  ChangingGoal& goal_;
  double next_counts_s_ = 0, next_set_point_s_ = 0;
  std::string said_counts_;
  std::map<std::string, double> next_remarks_s_;
  bool said_ended_ = false, two_endoscopes_ = false;
  std::size_t said_motions_ = 0;
};

int end_by_page() {
  std::printf("end: requested on the page\n");
  return 1;
}

// Waits until something holds, the user ends the run, or wait_s has passed; says whether it is one of the former two.
using Wait = std::function<bool(const std::function<bool()>&)>;

// Why the loop can't begin; empty where the arm's joints arrive and the camera's topic has a publisher.
std::string wait_for_topics(const ServoOptions& options, Transports& transports, Supervisor& arm, const Wait& wait) {
  if (!wait([&] { return arm.state().time_s > 0; })) {
    const std::string why = transports.unpublished(options.robot, "--robot", "measured_js");
    return fmt::format("{}: no measured_js with the rig's joints within {:.0f} s{}", options.robot, wait_s,
                       why.empty() ? "" : ": " + why);
  }
  if (!names_topic(options.camera)) return {};
  std::string why;
  wait([&] { return (why = transports.unpublished(options.camera, "--camera")).empty(); });
  return why.empty() ? "" : fmt::format("{}: no images within {:.0f} s: {}", options.camera, wait_s, why);
}

void say_counts(const InterlockCounts& arm, const ImageCounts& images) {
  std::printf("%ld joint states; setpoints: %ld sent, %ld withheld; dropped: %ld malformed, %ld repeated, %ld late, ",
              arm.joint_states, arm.set_points, arm.withheld, arm.malformed, arm.repeated, arm.late);
  std::printf("%ld after a jump of the clock, %ld without a stamp\n", arm.jumped, arm.unstamped);
  if (arm.pauses > 0)
    std::printf("the arm was silent %ld times while it moved, for up to %.2f s\n", arm.pauses, arm.longest_pause_s);
  std::printf("%ld images%s%s\n", images.taken, images.text().empty() ? "" : "; ", images.text().c_str());
}

}  // namespace

int steer_arm(const ServoOptions& options) {
  const Address address = address_of(options.robot, "--robot");
  const FrameNames frames = frame_names_of(options.frames);
  if (options.enable_motion) require_joint_limits("--enable-motion", options.joint_limits);
  RunConfig config = run_config_of(options);
  const Rig rig = config.rig;
  const InterlockConfig interlock = interlock_of(arm_of(options, rig), config.controller.limits, options.enable_motion,
                                                 static_cast<std::size_t>(options.setpoint_readers));
  if (!options.endoscope.empty() &&
      (config.controller.mode != ControlMode::fused || !rig.instruments.front().camera_from_rcm))
    throw InputError("--endoscope", "needs camera_from_rcm in the rig and --method default");
  if (config.controller.mode == ControlMode::uncalibrated) forget_registration(config, options);
  config.tracking_thread = TrackingThread::own;
  config.arm_limits = config.controller.limits;  // without --enable-motion they limit what is reported only
  const Trajectory trajectory = trajectory_of(options);

  std::optional<ServoPage> page;
  if (options.web.port) page.emplace(options, config.rig, "servo " + options.robot, options.enable_motion);

  Transports transports("lapservo");
  SteadyClock clock;
  LiveImages images(options.camera, "--camera", rig.camera, clock, transports);
  Transport& transport = transports.get(address.transport, "--robot");
  CrtkRobot robot(transport, address.name, interlock, clock);
  Supervisor arm(robot, clock);
  std::optional<OperatorPresence> operator_presence;
  if (options.page_says_operator_present()) {
    arm.watch_operator([&] { return page->operator_present(); });
  } else if (!options.operator_present.empty()) {
    operator_presence.emplace(transport, options.operator_present, clock);
    arm.watch_operator([&] { return operator_presence->was_present(); });
  }
  // Before the arm is heard, so that another loop of this name is.
  LoopTopics topics(transport, rig, frames, options.may_command("topics"));
  std::optional<ArmPose> endoscope_arm;
  std::optional<HeldEndoscope> endoscope;
  if (!options.endoscope.empty()) {
    const Address ecm = address_of(options.endoscope, "--endoscope");
    endoscope_arm.emplace(transports.get(ecm.transport, "--endoscope"), ecm.name, clock);
    config.endoscope = &endoscope.emplace(*endoscope_arm);
  }
  watch_for_interrupts();
  ServoPage* const its_page = page ? &*page : nullptr;
  const auto ended_by_page = [&] { return page && page->command(arm, clock.now_s()); };
  const Wait wait = [&](const auto& holds) { return wait_until([&] { return ended_by_page() || holds(); }, wait_s); };
  std::string missing = wait_for_topics(options, transports, arm, wait);
  if (missing.empty() && endoscope && !wait([&] { return endoscope->begin(); }))
    missing = fmt::format("{}: no measured_cp with a stamp within {:.0f} s (a dVRK stamps it once the arm is homed)",
                          options.endoscope, wait_s);
  if (ended_by_page()) return end_by_page();
  if (topics.name_is_in_use()) throw InputError("--rig", name_in_use(rig));
  if (interrupted()) missing = "stopped";
  if (!missing.empty()) {
    std::fprintf(stderr, "lapservo: %s\n", missing.c_str());
    return 1;
  }
  if (const std::string not_granted = robot.not_granted(); options.enable_motion && !not_granted.empty())
    std::printf("setpoints leave without %s, see docs/ros.md\n", not_granted.c_str());
  RunFolder folder(options, options.duration_s(), rig, controller_of(config));

  ChangingGoal goal(trajectory, config);
  ArmWatcher watcher(options, folder, arm, its_page, config, robot, endoscope_arm ? &*endoscope_arm : nullptr, images,
                     topics, goal);
  if (ended_by_page()) return end_by_page();
  request_real_time(loop_priority);  // the robot has said what is not granted
  lapservo::run(arm, images, clock, config, goal.trajectory(), options.duration_s(), watcher);
  say_counts(robot.counts(), images.counts());
  std::printf("%s\n", watcher.summary().text().c_str());
  return folder.commit() && watcher.summary().succeeded(options.strict) ? 0 : 1;
}

}  // namespace lapservo::app
