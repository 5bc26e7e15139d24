#include "lapservo/servo/run.h"

#include <algorithm>
#include <cmath>

#include "lapservo/control/motion_limits.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/servo.h"
#include "lapservo/servo/track_images.h"

namespace lapservo {
using namespace internal;
namespace {

// An image alone can't tell an endoscope that moved from an instrument that did; the joints do.
void withhold_contradicted(ControlTick& tick) {
  const HoldReason reason = tick.decision.control.reason;
  const bool contradicted = reason == HoldReason::outlier || reason == HoldReason::endoscope_moved;
  if (!tick.seen || !(contradicted || tick.decision.release)) return;
  tick.seen->observations.front().rcm.reset();
  tick.seen->observations.front().features.r_px.reset();
  tick.seen->measurement.found = false;
}

}  // namespace

void run(Robot& robot, ImageStream& images, Clock& clock, const RunConfig& config, const Trajectory& trajectory,
         double duration_s, RunObserver& observer) {
  Servo servo(config.controller, config.rig);
  const auto vision = track_images(images, config.rig, config.tracker, config.rcm_px, config.tracking_thread);
  const double period_s = config.controller.period_s, start_s = clock.now_s();
  const auto ticks = std::lround(duration_s / period_s);
  bool go_on = true;
  int registration = 0;
  for (long k = 0; k < ticks && go_on;) {
    ControlTick tick;
    tick.seen = vision->newest();
    tick.input.time_s = clock.now_s();
    tick.input.readings = robot.readings();
    tick.input.joints = robot.state();
    tick.input.desired = trajectory.at(tick.input.time_s - start_s);
    if (tick.seen) tick.input.image = tick.seen->measurement;
    tick.decision = servo.step(tick.input);
    if (tick.decision.send) robot.send(servo.path());
    if (tick.decision.release) robot.release();
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
  // No more velocities: the path brakes by itself.
  clock.sleep_until(clock.now_s() + stopping_time_s(config.controller.limits) + period_s);
}

}  // namespace lapservo
