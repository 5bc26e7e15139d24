#include "apps/lapservo/commands/servo/servo_recording.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <string>
#include <utility>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/commands/servo/servo_output.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "recordings/open_bag.h"
#include "recordings/replayed_run.h"

namespace lapservo::app {
using namespace internal;
namespace {

class RecordingWatcher : public RunObserver {
 public:
  RecordingWatcher(const ReplayedRun& recorded, RunFolder* folder, bool strict)
      : recorded_(recorded), folder_(folder), progress_(recorded.image_count()), strict_(strict) {}

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
    progress_.show(recorded_.images_given(), "");
    if (strict_ && summary_.registration_contradicted()) return false;
    return !recorded_.ended() && !interrupted();
  }
  const RunSummary& summary() const { return summary_; }
  bool acted() const { return acted_; }
  double duration_s() const { return duration_s_; }

 private:
  const ReplayedRun& recorded_;
  RunFolder* folder_;
  Progress progress_;
  bool strict_;
  RunSummary summary_;
  std::optional<double> start_s_;
  double duration_s_ = 0;
  bool acted_ = false;
  std::string state_;
};

}  // namespace

int decide_on_recording(const ServoOptions& options) {
  RunConfig config = run_config_of(options);
  const Rig rig = config.rig;
  if (config.controller.mode == ControlMode::uncalibrated) forget_registration(config, options);
  const Trajectory trajectory = trajectory_of(options);

  auto bag = open_bag(options.replay);
  say_remark(options.replay, bag->remark());
  ReplayedRun recorded(std::move(bag), options.image_topic, options.joint_topic, rig.instruments.front().name,
                       joints_of(options, rig));
  if (const double lead_s = recorded.arm_clock_lead_s(); std::abs(lead_s) > 0.3)
    std::printf("the arm's clock is %.2f s %s the camera's, by when both were recorded\n", std::abs(lead_s),
                lead_s > 0 ? "ahead of" : "behind");
  const double asked_s = std::min(options.duration.value_or(recorded.duration_s()), recorded.duration_s());
  std::optional<RunFolder> folder;
  if (!options.out.empty()) folder.emplace(options, asked_s, rig, config.controller);
  watch_for_interrupts();

  RecordingWatcher watcher(recorded, folder ? &*folder : nullptr, options.strict);
  lapservo::run(recorded.arm(), recorded.images(), recorded.clock(), config, trajectory, asked_s, watcher);
  std::printf("decided on %.1f s of a recording, %d images and the joints; nothing was sent%s\n", watcher.duration_s(),
              recorded.images_given(), watcher.summary().holds_text().c_str());
  say_remark(options.replay, recorded.complaint());
  say_remark(options.replay, recorded.joint_remark());
  const bool logged = !folder || folder->commit();
  if (folder && logged) std::printf("log, rig and controller: %s\n", options.out.c_str());
  return logged && watcher.acted() && !(options.strict && watcher.summary().registration_contradicted()) ? 0 : 1;
}

}  // namespace lapservo::app
