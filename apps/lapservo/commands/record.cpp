#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <optional>
#include <poll.h>
#include <string>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/live_images.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/control/calibration_motion.h"
#include "lapservo/control/motion_follower.h"
#include "lapservo/control/motion_limits.h"
#include "lapservo/core/error.h"
#include "lapservo/core/wall_clock.h"
#include "lapservo/crtk/arm_limits.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/rig/joint_travel.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/robot/supervisor.h"
#include "recordings/bag_recorder.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr double patience_s = 15;    // for the first image
constexpr double max_silence_s = 1;  // of the camera while the arm moves
constexpr double least_swing = 1.2;  // of least_joint_travel: what growing and fading leave of a swing's ends

// Writes arriving messages into the bag.
class Recording {
 public:
  Recording(const RecordOptions& options, const std::optional<Rig>& rig, Transports& transports, const Clock& clock)
      : recorder_(options.out, options.fps) {
    if (!options.robot.empty()) subscribe_joints(transports, address_of(options.robot, "--robot"));
    const cv::Size size = rig ? cv::Size(rig->camera.width_px, rig->camera.height_px) : cv::Size();
    input_ = open_images(options.camera, "--camera", size, transports, sink_of(options.camera, clock));
  }

  RecordedCounts counts() const { return recorder_.counts(); }
  void check() const { recorder_.check(); }
  void finish() {
    input_ = {}, joints_.reset();
    recorder_.finish();
  }
  std::optional<std::string> ended() const { return input_.ended(); }

 private:
  void subscribe_joints(Transports& transports, const Address& arm) {
    const std::string topic = topic_of(arm.name, "measured_js");
    joints_ =
        transports.get(arm.transport, "--robot").subscribe<JointMessage>(topic, [this, topic](JointMessage&& message) {
          recorder_.add(topic, std::move(message));
        });
  }
  ImageSink sink_of(const std::string& camera, const Clock& clock) {
    const std::string topic = recorded_topic(camera);
    return {[this, topic, &clock, has_stamps = names_topic(camera)](ImageMessage&& message) {
              // Those of this computer's cameras are on the monotonic clock, or missing; joints' are on that of 1970.
              const double age_s = std::isfinite(message.stamp_s) ? clock.now_s() - message.stamp_s : 0;
              if (!has_stamps) message.stamp_s = since_1970_s() - age_s;
              recorder_.add(topic, std::move(message));
            },
            [this, topic](CompressedImageMessage&& message) { recorder_.add(topic, std::move(message)); }};
  }

  BagRecorder recorder_;
  Transport::Subscription joints_;  // these last: they use the recorder
  ImageInput input_;
};

// The arm on its way along a motion.
class MovingArm {
 public:
  MovingArm(const RecordOptions& options, const Instrument& instrument, Transports& transports, const Clock& clock)
      : options_(options),
        clock_(clock),
        config_(config_of(options, instrument)),
        address_(address_of(options.robot, "--robot")),
        robot_(transports.get(address_.transport, "--robot"), address_.name, config_, clock),
        arm_(robot_, clock) {}
  // However it ends, the arm comes to rest.
  ~MovingArm() {
    arm_.end();
    std::this_thread::sleep_for(
        std::chrono::duration<double>(stopping_time_s(config_.limits) + MotionFollower::period_s));
  }

  // How far each joint moved; empty before it began.
  std::string travels() const { return readings_.empty() ? "" : travels_text(config_.joints, ranges_of(readings_)); }

  // Nothing while it is on its way or about to begin, then why it has ended: empty when the motion is done.
  std::optional<std::string> advance() {
    const JointState measured = arm_.state();
    if (arm_.held()) return arm_.text();
    const bool moved = std::exchange(moves_, arm_.armed());
    if (!moves_) return std::nullopt;
    const double now_s = clock_.now_s();
    if (follower_ && !moved) follower_->resume(now_s, measured.q);
    if (!follower_) {
      const Eigen::Vector4d start = measured.q.vector();
      if (std::string still = options_.move == "swing" ? still_in_swing(start) : ""; !still.empty()) return still;
      follower_.emplace(motion_from(start), config_.limits, config_.max_distance, now_s);
    }
    const Eigen::Vector4d at = joints_from_q(config_.joints, measured.q.vector());
    if (at.allFinite()) readings_.push_back({at[0], at[1], at[2], at[3]});
    const MotionFollower::Step step = follower_->step(now_s, measured.q);
    if (step.path) arm_.send(*step.path);
    if (step.progress == MotionFollower::Progress::does_not_follow) return "the arm does not follow";
    return step.progress == MotionFollower::Progress::done ? std::optional(std::string()) : std::nullopt;
  }

 private:
  static InterlockConfig config_of(const RecordOptions& options, const Instrument& instrument) {
    if (!instrument.joints)
      throw InputError(options.rig,
                       "joints of " + instrument.name + " is missing, expected the arm's joints: names, sign, offset");
    const InterlockConfig config =
        interlock_of(instrument, limits_of_q(*instrument.joints, load_arm_limits(options.joint_limits)),
                     options.enable_motion, static_cast<std::size_t>(options.setpoint_readers));
    // Refused now where there is no room for it, wherever the arm is.
    if (options.move == "turn") turn_motion(Eigen::Vector4d::Zero(), config.limits, options.joint_limits);
    return config;
  }
  JointMotion motion_from(const Eigen::Vector4d& start) const {
    return options_.move == "turn" ? turn_motion(start, config_.limits, options_.joint_limits)
                                   : swing_motion(start, config_.limits, options_.scale, options_.duration_s);
  }
  // Which joints would move too little for `calibrate registration`, and why; empty when there is none.
  std::string still_in_swing(const Eigen::Vector4d& start) const {
    const Eigen::Vector4d reach = swing_reach(start, config_.limits, options_.scale, options_.duration_s);
    const Eigen::Vector4d at = joints_from_q(config_.joints, start);
    const Eigen::Vector4d room = (config_.limits.upper - start).cwiseMin(start - config_.limits.lower);
    std::vector<std::string> still;
    for (Eigen::Index i = 0; i < 4; ++i) {
      const auto j = static_cast<std::size_t>(i);
      if (2 * reach[i] >= least_swing * least_joint_travel[j]) continue;
      const std::string why = room[i] <= reach[i]
                                  ? fmt::format("it stands at {}, {} from its limit of {}: move it away from there",
                                                joint_text(j, at[i]), joint_text(j, room[i]), options_.joint_limits)
                                  : std::string("a longer --duration or a larger --scale moves it more");
      still.push_back(fmt::format("{} would move by {}, registration needs {}: {}", config_.joints.names[j],
                                  joint_text(j, 2 * reach[i]), joint_text(j, least_swing * least_joint_travel[j]),
                                  why));
    }
    return still.empty() ? "" : fmt::format("the arm was not moved: {}", fmt::join(still, "; "));
  }

  const RecordOptions& options_;
  const Clock& clock_;
  InterlockConfig config_;
  Address address_;
  CrtkRobot robot_;
  Supervisor arm_;
  std::optional<MotionFollower> follower_;
  bool moves_ = false;
  std::vector<std::array<double, 4>> readings_;  // while it moved
};

// Before anything is opened or made.
void expect_possible(const RecordOptions& options) {
  if (options.move.empty()) return;
  if (options.robot.empty()) throw InputError("--move", "needs --robot, for example --robot ros2:PSM1");
  if (options.rig.empty()) throw InputError("--move", "needs --rig, whose joints entry names the arm's joints");
  if (!options.enable_motion)
    throw InputError("--move", "moves the arm: give --enable-motion too, once nothing is in its way");
  require_joint_limits("--move", options.joint_limits);
}

bool line_was_entered() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (::poll(&input, 1, 0) <= 0) return false;
  std::string line;
  std::getline(std::cin, line);
  return true;
}

std::string told(const RecordedCounts& counts) {
  std::string text = fmt::format("{} images, {} joint readings", counts.images, counts.joints);
  if (counts.dropped > 0)
    text += fmt::format(", {} images dropped: the disk or the processor is too slow", counts.dropped);
  if (counts.unstamped > 0) text += fmt::format(", {} messages without a stamp left out", counts.unstamped);
  for (const auto& [topic, count] : counts.of_second_senders)
    text += fmt::format(", {} messages of a second sender of {} left out", count, topic);
  return text;
}

// Once for each topic.
void say_second_senders(const RecordedCounts& counts) {
  for (const auto& [topic, count] : counts.of_second_senders)
    say_remark(topic,
               "another program publishes it, too: its messages are left out until the first one has been silent for "
               "0.5 s");
}

// `unpublished`: see Transports.
std::string missing(const std::string& what, const RecordedCounts& counts, const std::string& unpublished) {
  if (counts.unstamped > 0)
    return fmt::format("no {} with a stamp came within {:.0f} s, but {} messages without: let the driver stamp them",
                       what, patience_s, counts.unstamped);
  return fmt::format("no {} came within {:.0f} s{}{}", what, patience_s, unpublished.empty() ? "" : ": ", unpublished);
}

// Why the recording ends; empty: as it should.
std::string wait_for_end(const RecordOptions& options, const Clock& clock, Recording& recording, MovingArm* arm,
                         Transports& transports) {
  Progress progress(std::nullopt);
  std::optional<double> first_s;
  const double begin_s = clock.now_s();
  double last_image_s = begin_s;
  long images = 0;
  while (!interrupted()) {
    recording.check();
    const RecordedCounts counts = recording.counts();
    say_second_senders(counts);
    const double now_s = clock.now_s();
    if (std::exchange(images, counts.arrived) != counts.arrived)
      last_image_s = now_s;  // a slow disk is no silent camera
    if (!first_s && counts.arrived > 0) first_s = now_s;
    progress.show(static_cast<int>(counts.images), fmt::format(" images, {} joint readings", counts.joints));
    if (!first_s && now_s > begin_s + patience_s)
      return missing("image", counts,
                     names_topic(options.camera) ? transports.unpublished(options.camera, "--camera") : std::string());
    if (!options.robot.empty() && counts.joints == 0 && now_s > begin_s + patience_s)
      return missing("measured_js", counts, transports.unpublished(options.robot, "--robot", "measured_js"));
    if (const auto ended = recording.ended())
      return ended->empty() && arm ? "its images have ended before the motion" : *ended;
    if (first_s && arm && now_s > last_image_s + max_silence_s) return "its images have stopped";
    if (first_s && arm) {
      if (const auto ended = arm->advance()) return *ended;
    } else if (first_s && (options.until_enter ? line_was_entered() : now_s > *first_s + options.duration_s)) {
      return "";
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(MotionFollower::period_s));
  }
  return arm ? "stopped before the motion ended" : "";
}

// Throws InputError for an option that would be ignored.
void refuse_unused(const RecordOptions& options, const Command& command) {
  if (options.move.empty())
    command.refuse({"--instrument", "--scale", "--setpoint-readers", "--joint-limits", "--enable-motion"},
                   "is of a motion, expected --move with it");
  if (options.move == "turn")
    command.refuse({"--duration", "--scale"}, "does not change a turn, expected --move swing with it");
}

}  // namespace

int record(const RecordOptions& options) {
  expect_possible(options);
  const std::optional<Rig> rig = options.rig.empty() ? std::nullopt : std::optional(load_rig(options.rig));
  Transports transports("lapservo_record");
  SteadyClock clock;
  std::optional<MovingArm> arm;
  if (!options.move.empty())
    arm.emplace(options, rig->instruments[instrument_meant(*rig, options.instrument, options.rig)], transports, clock);
  Recording recording(options, rig, transports, clock);
  watch_for_interrupts();
  const std::string why = wait_for_end(options, clock, recording, arm ? &*arm : nullptr, transports);
  recording.finish();
  const RecordedCounts counts = recording.counts();
  std::printf("%s: %s\n", options.out.c_str(), told(counts).c_str());
  if (const std::string travels = arm ? arm->travels() : ""; !travels.empty()) std::printf("%s\n", travels.c_str());
  if (!why.empty()) std::fprintf(stderr, "lapservo: %s: %s\n", options.out.c_str(), why.c_str());
  if (why.empty() && !options.robot.empty() && counts.joints == 0)
    std::fprintf(stderr, "lapservo: %s: no measured_js came\n", options.robot.c_str());
  return why.empty() && counts.images > 0 && (options.robot.empty() || counts.joints > 0) ? 0 : 1;
}

void add_record(Command app) {
  const auto job = [](const RecordOptions& options, const Command& command) {
    refuse_unused(options, command);
    return record(options);
  };
  auto [command, options] = app.add_subcommand<RecordOptions>(
      "record", "Record a camera and an arm's joints into a bag, for calibrate, check and track.", job);
  command.add_option(
      "--camera", options.camera, required(),
      "Images: ros2:/topic or ros1:/topic, an Image or, where it ends in /compressed, a CompressedImage; "
      "/dev/videoN; gst:PIPELINE");
  command.add_option("--robot", options.robot, "The arm whose measured_js is recorded too: ros2:PSM1 or ros1:PSM1");
  command.add_option("--out", options.out, required(),
                     "Folder to make: a ROS 2 bag (MCAP); a second of raw 720p takes 80 MB");
  command.add_option("--rig", options.rig,
                     "Its camera's size is that of /dev/videoN, else GStreamer's choice; also for --move");
  command.add_option("--duration", options.duration_s, between(1, 3600),
                     "Seconds, from the first image on; a turn takes its own time");
  command.add_option("--fps", options.fps, between(1, 1000), "Keep no more images a second than about so many");
  command.add_option(
      "--move", options.move, one_of({"swing", "turn"}),
      "Move the arm meanwhile, from where it is, as the calibrations want it: swing (registration, check: "
      "all joints, for --duration), turn (marker: a full turn about its axis)");
  command.add_option("--instrument", options.instrument, "For --move: the arm's name in the rig, where it has several");
  command.add_option("--scale", options.scale, between(0.05, 4),
                     "Scale of a swing: 1 is 0.25 rad, 0.2 rad, 10 mm, 1 rad to either side at most");
  add_setpoint_readers_option(command, options.setpoint_readers);
  command.add_option("--joint-limits", options.joint_limits,
                     "For --move: YAML of the arm's joints, between which they stay, for example "
                     "configs/joint_limits/psm-classic.yaml");
  command.add_flag("--enable-motion", options.enable_motion, "For --move: do move the arm");
  command.footer(
      "An arm that is moved starts from rest, when it has been ready for half a second, and ends at rest; whatever is "
      "amiss with it ends the motion, and it stays where it is.\n"
      "A swing is centred on where the arm is. It does not begin where a joint has too little room within "
      "--joint-limits.\n"
      "Example:\n  lapservo record --camera ros2:/endoscope/image_raw --robot ros2:PSM1 --out swing\n"
      "  lapservo calibrate registration swing --rig rig.yaml --out rig.yaml");
}

}  // namespace lapservo::app
