#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/commands/servo/run_watcher.h"
#include "apps/lapservo/commands/servo/servo_options.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "recordings/bag_topics.h"
#include "recordings/open_bag.h"
#include "recordings/replayed_run.h"

namespace lapservo::app {
using namespace internal;
namespace {

class RecordingWatcher : public RunWatcher {
 public:
  RecordingWatcher(const ServoOptions& options, RunFolder& folder, const ReplayedRun& recorded)
      : RunWatcher(options, folder, nullptr, nullptr), recorded_(recorded), progress_(recorded.image_count()) {}
  bool acted() const { return acted_; }

 private:
  bool follow(const ControlTick& tick, double time_s) override {
    acted_ |= tick.decision.control.action != ControlAction::hold;
    if (is_new_state()) {
      progress_.clear();
      say(time_s, state());
    }
    progress_.show(recorded_.images_given(), "");
    return !recorded_.ended();
  }

  const ReplayedRun& recorded_;
  Progress progress_;
  bool acted_ = false;
};

}  // namespace

int decide_on_recording(const ServoOptions& options) {
  RunConfig config = run_config_of(options);
  const Rig rig = config.rig;
  if (config.controller.mode == ControlMode::uncalibrated) forget_registration(config, options);
  const Trajectory trajectory = trajectory_of(options);

  const std::string path = bag_of(options.recorded.input);
  const auto bag = open_bag(path);
  const BagTopic* images = nullptr;  // a session's images have the times of the recorder
  if (path == options.recorded.input) {
    images = &image_topic_of(*bag, options.recorded.image_topic);
  } else {
    say_remark(path, bag->remark());
  }
  const Instrument& instrument = arm_of(options, rig);
  auto frames = open_frames(options.recorded.input, options.recorded, &rig.camera);
  auto wrist = find_wrist_input(options.recorded, rig, 0, *frames, false);
  if (const std::string why = no_tip_text(instrument, wrist); !why.empty())
    say_remark(options.recorded.input, "no tip: " + why);
  ReplayedRun recorded(std::move(frames), *bag, images, options.recorded.joint_topic, instrument,
                       wrist.readings ? std::optional(std::move(wrist.readings->recording)) : std::nullopt);
  if (const double lead_s = recorded.arm_clock_lead_s(); std::abs(lead_s) > 0.3)
    std::printf("the arm's clock is %.2f s %s the camera's, by when both were recorded\n", std::abs(lead_s),
                lead_s > 0 ? "ahead of" : "behind");
  const double asked_s = std::min(options.duration.value_or(recorded.duration_s()), recorded.duration_s());
  RunFolder folder(options, asked_s, rig, config.controller);
  watch_for_interrupts();

  RecordingWatcher watcher(options, folder, recorded);
  lapservo::run(recorded, recorded, recorded, config, trajectory, asked_s, watcher);
  std::printf("decided on %.1f s of a recording, %d images and the joints; nothing was sent%s\n", watcher.duration_s(),
              recorded.images_given(), watcher.summary().holds_text().c_str());
  say_remark(options.recorded.input, recorded.complaint());
  say_remark(options.recorded.input, recorded.joint_remark());
  return folder.commit() && watcher.acted() && !(options.strict && watcher.summary().registration_contradicted()) ? 0
                                                                                                                  : 1;
}

}  // namespace lapservo::app
