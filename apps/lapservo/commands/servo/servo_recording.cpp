#include "apps/lapservo/commands/servo/servo_recording.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/commands/servo/servo_output.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/interlock.h"
#include "lapservo/rig/joint_conversion.h"
#include "recordings/bag_frames.h"
#include "recordings/bag_joints.h"
#include "recordings/bag_topics.h"
#include "recordings/open_bag.h"

namespace lapservo::app {
using namespace internal;
namespace {

// Times: seconds since the stamp of the bag's first image.
class RecordedClock : public Clock {
 public:
  explicit RecordedClock(double start_s) : now_s_(start_s) {}
  double now_s() const override { return now_s_; }
  void sleep_until(double time_s) override { now_s_ = std::max(now_s_, time_s); }

 private:
  double now_s_;
};

// A CRTK arm that another program moves: enabled while it sends joint states, deaf to setpoints.
class RecordedArm : public Robot {
 public:
  RecordedArm(const JointRecording& recording, const Joints& joints, const Clock& clock) : clock_(clock) {
    for (std::size_t i = 0; i < recording.time_s.size(); ++i)
      readings_.push_back({recording.time_s[i], JointVector::from_vector(q_from_joints(
                                                    joints, Eigen::Vector4d(recording.joints[i].data())))});
    while (next_ < readings_.size() && readings_[next_].time_s <= clock.now_s()) ++next_;
  }
  std::vector<JointReading> readings() override {
    std::vector<JointReading> since;
    for (; next_ < readings_.size() && readings_[next_].time_s <= clock_.now_s(); ++next_)
      since.push_back(readings_[next_]);
    return since;
  }
  JointState state() override {
    const JointReading& latest = readings_[std::max<std::size_t>(next_, 1) - 1];
    const bool known = clock_.now_s() - latest.time_s <= max_age_s_;
    return {latest.time_s, latest.q, known ? OperatingState::enabled : OperatingState::disabled, false};
  }
  void send(const JointPath&) override {}
  bool is_simulated() const override { return true; }  // nothing moves

 private:
  const Clock& clock_;
  const double max_age_s_ = InterlockConfig().max_age_s;
  std::vector<JointReading> readings_;
  std::size_t next_ = 0;
};

// Each at the time of its stamp.
class RecordedImages : public ImageStream {
 public:
  RecordedImages(FrameSource& frames, const Clock& clock) : frames_(frames), clock_(clock), next_(frames.next()) {}
  std::optional<StampedImage> newest() override {
    std::optional<StampedImage> newest;
    for (; next_ && next_->time_s <= clock_.now_s(); next_ = frames_.next(), ++count_)
      if (!next_->flaw) newest = StampedImage{next_->time_s, next_->bgr};
    return newest;
  }
  bool ended() const { return !next_; }
  int count() const { return count_; }

 private:
  FrameSource& frames_;
  const Clock& clock_;
  std::optional<Frame> next_;
  int count_ = 0;
};

class RecordingWatcher : public RunObserver {
 public:
  RecordingWatcher(const RecordedImages& images, RunFolder* folder, std::optional<int> total, bool strict)
      : images_(images), folder_(folder), progress_(total), strict_(strict) {}

  bool on_tick(const ControlTick& tick) override {
    if (!start_s_) start_s_ = tick.input.time_s;
    duration_s_ = tick.input.time_s - *start_s_;
    summary_.add(tick, std::nullopt);
    if (folder_) folder_->add(tick, std::nullopt);
    acted_ |= tick.decision.control.action != ControlAction::hold;
    if (const std::string state = state_text(tick.decision); state != state_) {
      state_ = state;
      progress_.clear();
      say(duration_s_, state);
    }
    progress_.show(images_.count(), "");
    if (strict_ && summary_.registration_contradicted()) return false;
    return !images_.ended() && !interrupted();
  }
  const Summary& summary() const { return summary_; }
  bool acted() const { return acted_; }
  double duration_s() const { return duration_s_; }

 private:
  const RecordedImages& images_;
  RunFolder* folder_;
  Progress progress_;
  bool strict_;
  Summary summary_;
  std::optional<double> start_s_;
  double duration_s_ = 0;
  bool acted_ = false;
  std::string state_;
};

JointRecording joints_of_bag(const Bag& bag, const ServoOptions& options, const Rig& rig, double begin_s) {
  const BagTopic* topic = joint_topic_of(bag, options.joint_topic, rig.instruments.front().name);
  if (!topic)
    throw InputError(bag.path(), std::string("has no messages of ") + joint_type + ", expected the arm's joints");
  JointRecording recording = joints_in_bag(bag, *topic, joints_of(options, rig), begin_s);
  const double lead_s = clock_lead_s(bag, *topic, image_topic_of(bag, options.image_topic));
  for (double& time_s : recording.time_s) time_s -= lead_s;
  if (std::abs(lead_s) > 0.3)
    std::printf("the arm's clock is %.2f s %s the camera's, by when both were recorded\n", std::abs(lead_s),
                lead_s > 0 ? "ahead of" : "behind");
  return recording;
}

}  // namespace

int decide_on_recording(const ServoOptions& options) {
  RunConfig config = run_config_of(options);
  const Rig rig = config.rig;
  if (config.controller.mode == ControlMode::uncalibrated) forget_registration(config, options);
  const Trajectory trajectory = trajectory_of(options);

  const auto bag = open_bag(options.replay);
  BagFrames frames(bag, options.image_topic);
  const JointRecording joints = joints_of_bag(*bag, options, rig, *frames.first_stamp_s());
  const double start_s = std::max(0.0, joints.time_s.front()), recorded_s = joints.time_s.back() - start_s;
  if (!(recorded_s > 0))
    throw InputError(bag->path(),
                     fmt::format("its joints end {:.3f} s before its first image, expected both at one time",
                                 -joints.time_s.back()));
  const double asked_s = std::min(options.duration.value_or(recorded_s), recorded_s);
  RecordedClock clock(start_s);
  RecordedArm arm(joints, *rig.instruments.front().joints, clock);
  RecordedImages images(frames, clock);
  std::optional<RunFolder> folder;
  if (!options.out.empty()) folder.emplace(options, asked_s, rig, config.controller);
  watch_for_interrupts();

  RecordingWatcher watcher(images, folder ? &*folder : nullptr, frames.frame_count(), options.strict);
  lapservo::run(arm, images, clock, config, trajectory, asked_s, watcher);
  std::printf("decided on %.1f s of a recording, %d images and the joints; nothing was sent%s\n", watcher.duration_s(),
              images.count(), watcher.summary().holds_text().c_str());
  if (const std::string complaint = frames.complaint(); !complaint.empty())
    std::fprintf(stderr, "lapservo: %s: %s\n", bag->path().c_str(), complaint.c_str());
  const bool logged = !folder || folder->commit();
  if (folder && logged) std::printf("log, rig and controller: %s\n", options.out.c_str());
  return logged && watcher.acted() && !(options.strict && watcher.summary().registration_contradicted()) ? 0 : 1;
}

}  // namespace lapservo::app
