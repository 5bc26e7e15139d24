#include "lapservo/servo/run.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "lapservo/control/motion_limits.h"
#include "lapservo/core/error.h"
#include "lapservo/servo/goal_check.h"
#include "lapservo/servo/moving_camera.h"
#include "lapservo/servo/servo.h"
#include "lapservo/servo/tip_goals.h"
#include "lapservo/servo/track_images.h"

namespace lapservo {
using namespace internal;
namespace {

// An image alone can't distinguish a moved endoscope from a moved instrument; the joints do.
void withhold_contradicted(ControlTick& tick) {
  const HoldReason reason = tick.decision.control.reason;
  const bool contradicted = reason == HoldReason::outlier || reason == HoldReason::endoscope_moved;
  if (!tick.seen || !(contradicted || tick.decision.release)) return;
  tick.seen->observations.front().rcm.reset();
  tick.seen->observations.front().features.r_px.reset();
  tick.seen->measurement.found = false;
}

Blocked needs_start(HoldReason reason) {
  switch (reason) {
    case HoldReason::not_following:
      return Blocked::displaced;
    case HoldReason::image_not_following:
    case HoldReason::error_grows:
    case HoldReason::delay_not_found:
      return Blocked::loop_held;
    default:
      return Blocked::none;
  }
}

void tell(Supervisor& arm, const ServoDecision& decision) {
  const ControlStep& control = decision.control;
  if (control.action != ControlAction::hold) return arm.tell_loop("");
  const std::string_view reason = to_string(control.reason);
  arm.tell_loop(decision.remedy.empty() ? std::string(reason) : fmt::format("{}: {}", reason, decision.remedy),
                needs_start(control.reason));
}

// However the loop ends, the arm comes to rest before those who drive it are gone.
class BrakesAtTheEnd {
 public:
  BrakesAtTheEnd(Supervisor& arm, Clock& clock, const ControllerConfig& config)
      : arm_(arm), clock_(clock), lasts_s_(stopping_time_s(config.limits) + config.period_s) {}
  ~BrakesAtTheEnd() {
    try {
      brake();
    } catch (...) {  // what ended the loop is on its way already
    }
  }
  // Throws what a port throws first; the path brakes by itself then.
  void brake() {
    if (std::exchange(braked_, true)) return;
    const auto wait = [&] { clock_.sleep_until(clock_.now_s() + lasts_s_); };
    try {
      arm_.end();
    } catch (...) {
      try {
        wait();
      } catch (...) {  // the first counts
      }
      throw;
    }
    wait();
  }
  BrakesAtTheEnd(const BrakesAtTheEnd&) = delete;
  BrakesAtTheEnd& operator=(const BrakesAtTheEnd&) = delete;

 private:
  Supervisor& arm_;
  Clock& clock_;
  double lasts_s_;
  bool braked_ = false;
};

// Those of another clock would be compared with the wrong moments.
void refuse_other_clock(const char* source, double stamp_s, double now_s) {
  constexpr double max_ahead_s = 1;
  if (stamp_s - now_s > max_ahead_s)
    throw InputError(source, "time_s", fmt::format("{:.3f}", stamp_s),
                     fmt::format("a time of the loop's clock, which is at {:.3f}", now_s));
}

void refuse_at_once(const Supervisor& arm, const Clock& clock, const RunConfig& config, double duration_s) {
  if (!config.arm_limits && !arm.is_simulated())
    throw InputError("RunConfig", "arm_limits", "missing", "the limits of the arm's joints");
  if (!std::isfinite(duration_s) || duration_s < 0)
    throw InputError("run", "duration_s", fmt::format("{}", duration_s), "0 or more");
  if (const double now_s = clock.now_s(); !std::isfinite(now_s))
    throw InputError("Clock", "now_s", fmt::format("{}", now_s), "a finite time");
}

// Refuses what only the first joints and the first image show, before they move anything.
struct FirstSight {
  const RunConfig& config;
  const ControllerConfig& controller;
  const Trajectory& trajectory;
  double duration_s;
  bool saw_joints = false, saw_image = false;

  // `moving`: of an endoscope that may have moved meanwhile.
  void check(const ControlTick& tick, const Supervisor& arm, const std::optional<MovingCamera>& moving) {
    if (tick.seen && !std::exchange(saw_image, true))
      refuse_other_clock("ImageStream", tick.seen->image.time_s, tick.input.time_s);
    const JointState& joints = tick.input.joints;
    // While it is held, others still bring it to where the loop will begin.
    if (!joints.q.vector().allFinite() || arm.held() || saw_joints) return;
    const auto camera_from_rcm =
        moving ? moving->camera_from_rcm(tick.input.time_s) : config.rig.instruments.at(0).camera_from_rcm;
    if (moving && !camera_from_rcm) return;
    saw_joints = true;
    refuse_other_clock("JointState", joints.time_s, tick.input.time_s);
    if (arm.is_simulated() && !joints.follows) return;
    refuse_goal(trajectory, duration_s, config.rig, camera_from_rcm, controller, joints, config.trajectory_name);
  }
};

// The tip in an image by the wrist as it was then.
void add_tip(ControlTick& tick, const Instrument& instrument, const TipGoals& tips) {
  if (!tick.seen || !instrument.tool) return;
  Observation& seen = tick.seen->observations.front();
  const double exposed_s = tick.seen->measurement.time_s - tick.decision.control.delay_s;
  if (const auto wrist_rad = tips.past_wrist_rad(tick.input.time_s - exposed_s))
    seen.tip = tip_of(seen, *instrument.tool, *wrist_rad);
}

// Corrects goals of the tip by an image that the loop has used.
void watch_tip(ControlTick& tick, const Trajectory& trajectory, double begun_s,
               const std::optional<Rigid3>& first_from_rcm, TipGoals& tips) {
  if (!tick.seen || !first_from_rcm || tick.decision.control.reason != HoldReason::none) return;
  const ImageMeasurement& image = tick.seen->measurement;
  if (image.registration != tick.decision.registration) return;
  tips.see(image, tick.seen->first_from_camera.inverse() * *first_from_rcm);
  const double exposed_s = image.time_s - tick.decision.control.delay_s;
  const auto goal = trajectory.tip_at(exposed_s - begun_s);
  if (goal && image.found) tick.tip_error_px = tips.error_px(image, *goal, tick.input.time_s - exposed_s);
}

}  // namespace

ControllerConfig controller_of(const RunConfig& config) {
  ControllerConfig controller = config.controller;
  if (config.arm_limits) controller.limits = *config.arm_limits;
  if (config.endoscope) controller.window.reset();
  return controller;
}

void run(Robot& robot, ImageStream& images, Clock& clock, const RunConfig& config, const Trajectory& trajectory,
         double duration_s, RunObserver& observer) {
  Supervisor arm(robot, clock);
  run(arm, images, clock, config, trajectory, duration_s, observer);
}

void run(Supervisor& arm, ImageStream& images, Clock& clock, const RunConfig& config, const Trajectory& trajectory,
         double duration_s, RunObserver& observer) {
  refuse_at_once(arm, clock, config, duration_s);
  const ControllerConfig controller = controller_of(config);
  std::optional<MovingCamera> moving;
  if (config.endoscope) moving.emplace(*config.endoscope, config.rig, controller.scales);
  TipGoals tips(config.rig, controller.scales);
  if (trajectory.tip_at(0)) tips.refuse_incomplete(config.trajectory_name, false);
  const Trajectory features = tips.features_of(trajectory);
  std::optional<Rigid3> first_from_rcm =
      config.rig.instruments.at(0).camera_from_rcm;  // of the camera in its first place
  FirstSight first_sight{config, controller, trajectory, duration_s};
  Servo servo(controller, config.rig);
  const auto vision =
      track_images(images, config.rig, config.tracker, config.rcm_px, config.tracking_thread, config.endoscope);
  const double period_s = controller.period_s, start_s = clock.now_s();
  double begun_s = start_s, since_s = 0;  // the trajectory's
  // A goal of the tip shows other features from where the endoscope is then.
  const auto features_then = [&](double time_s) {
    if (trajectory.tip_at(time_s)) tips.use(moving->camera_from_rcm(begun_s + time_s));
    return features.at(time_s);
  };
  const Trajectory seen_then{0, features_then, {}};
  const auto ticks = std::lround(duration_s / period_s);
  BrakesAtTheEnd brakes(arm, clock, controller);
  bool go_on = true, held = false;
  int registration = 0;
  for (long k = 0; k < ticks && go_on;) {
    ControlTick tick;
    tick.seen = vision->newest();
    tick.input.time_s = clock.now_s();
    if (images.take_second_sender()) arm.report(Blocked::second_camera);
    tick.input.readings = arm.readings();
    tick.input.joints = arm.state();
    if (arm.armed() && !held)
      since_s = tick.input.time_s - begun_s;
    else if (std::isfinite(tick.input.time_s))
      begun_s = tick.input.time_s - since_s;
    tick.trajectory_s = since_s;
    tips.follow(tick.input.joints);
    if (moving) tips.use(moving->camera_from_rcm(tick.input.time_s));
    tick.input.desired = features.at(since_s);
    tick.pursues_tip = trajectory.tip_at(since_s).has_value();
    first_sight.check(tick, arm, moving);
    if (tick.seen) tick.input.image = tick.seen->measurement;
    if (moving) {
      vision->set_delay(servo.controller().delay_s());
      moving->carry(tick.input, since_s, seen_then, tick.seen ? tick.seen->first_from_camera : Rigid3());
      tips.use(moving->camera_from_rcm(tick.input.time_s));
    }
    tick.decision = servo.step(tick.input);
    held = tick.decision.control.action == ControlAction::hold;
    if (tick.decision.send) arm.send(servo.path());
    if (tick.decision.release) arm.release();
    tell(arm, tick.decision);
    add_tip(tick, config.rig.instruments.at(0), tips);
    watch_tip(tick, trajectory, begun_s, first_from_rcm, tips);
    if (tick.decision.registration != registration) {
      registration = tick.decision.registration;
      vision->use(tick.decision);
      first_from_rcm = tick.decision.camera_from_rcm;
      tips.use(first_from_rcm);
      if (moving) moving->use(tick.decision.camera_from_rcm);
    }
    withhold_contradicted(tick);
    go_on = observer.on_tick(tick);
    // The next tick that has not passed yet.
    k = std::max(k + 1, std::lround((clock.now_s() - start_s) / period_s));
    clock.sleep_until(start_s + static_cast<double>(k) * period_s);
  }
  brakes.brake();
}

}  // namespace lapservo
