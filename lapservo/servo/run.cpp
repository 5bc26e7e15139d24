#include "lapservo/servo/run.h"

#include <algorithm>
#include <cmath>

#include "lapservo/control/motion_limits.h"
#include "lapservo/core/error.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/servo.h"
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

void tell(Supervisor& arm, const ControlStep& control) {
  arm.tell_loop(control.action == ControlAction::hold ? to_string(control.reason) : "",
                control.reason == HoldReason::not_following);
}

// However the loop ends, the arm comes to rest before those who drive it are gone.
class BrakesAtTheEnd {
 public:
  BrakesAtTheEnd(Supervisor& arm, Clock& clock, const ControllerConfig& config)
      : arm_(arm), clock_(clock), lasts_s_(stopping_time_s(config.limits) + config.period_s) {}
  ~BrakesAtTheEnd() {
    try {
      arm_.end();
      clock_.sleep_until(clock_.now_s() + lasts_s_);
    } catch (...) {  // of a port that is gone: the path brakes by itself
    }
  }
  BrakesAtTheEnd(const BrakesAtTheEnd&) = delete;
  BrakesAtTheEnd& operator=(const BrakesAtTheEnd&) = delete;

 private:
  Supervisor& arm_;
  Clock& clock_;
  double lasts_s_;
};

}  // namespace

void run(Robot& robot, ImageStream& images, Clock& clock, const RunConfig& config, const Trajectory& trajectory,
         double duration_s, RunObserver& observer) {
  if (!config.arm_limits && !robot.is_simulated())
    throw InputError("RunConfig", "arm_limits", "missing", "the limits of the arm's joints");
  RunConfig limited = config;
  if (config.arm_limits) limited.controller.limits = *config.arm_limits;
  Supervisor arm(robot, clock);
  run(arm, images, clock, limited, trajectory, duration_s, observer);
}

void run(Supervisor& arm, ImageStream& images, Clock& clock, const RunConfig& config, const Trajectory& trajectory,
         double duration_s, RunObserver& observer) {
  Servo servo(config.controller, config.rig);
  const auto vision = track_images(images, config.rig, config.tracker, config.rcm_px, config.tracking_thread);
  const double period_s = config.controller.period_s, start_s = clock.now_s();
  const auto ticks = std::lround(duration_s / period_s);
  const BrakesAtTheEnd brakes(arm, clock, config.controller);
  bool go_on = true;
  int registration = 0;
  for (long k = 0; k < ticks && go_on;) {
    ControlTick tick;
    tick.seen = vision->newest();
    tick.input.time_s = clock.now_s();
    tick.input.readings = arm.readings();
    tick.input.joints = arm.state();
    tick.input.desired = trajectory.at(tick.input.time_s - start_s);
    if (tick.seen) tick.input.image = tick.seen->measurement;
    tick.decision = servo.step(tick.input);
    if (tick.decision.send) arm.send(servo.path());
    if (tick.decision.release) arm.release();
    tell(arm, tick.decision.control);
    if (tick.decision.registration != registration) {
      registration = tick.decision.registration;
      vision->use(registration, tick.decision.camera_from_rcm);
    }
    withhold_contradicted(tick);
    go_on = observer.on_tick(tick);
    // The next tick that has not passed yet.
    k = std::max(k + 1, std::lround((clock.now_s() - start_s) / period_s));
    clock.sleep_until(start_s + static_cast<double>(k) * period_s);
  }
}

}  // namespace lapservo
