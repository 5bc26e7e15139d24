#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/clock.h"
#include "lapservo/robot/robot.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/servo_decision.h"
#include "lapservo/servo/tracked_image.h"
#include "lapservo/stream/endoscope_pose.h"
#include "lapservo/stream/image_stream.h"
#include "lapservo/vision/tracker.h"

namespace lapservo {

struct RunConfig {
  Rig rig;  ///< the loop's rig; its first instrument is steered
  ControllerConfig controller;
  std::optional<Eigen::Vector2d> rcm_px;  ///< for r, where the rig has no camera_from_rcm; ideal pixels
  TrackerOptions tracker;
  TrackingThread tracking_thread = TrackingThread::callers;
  /// Limits of the arm's q, in the place of controller.limits: run() needs them with an arm that is not simulated.
  std::optional<JointLimits> arm_limits{};
  std::string trajectory_name = "trajectory";  ///< in complaints
  /// Of an endoscope that moves, which must outlive run(); needs the rig's camera_from_rcm, which is that of its first
  /// place. All of the loop, its log and ServoInput included, then works in the image of the camera in that place, to
  /// which images and goals are carried; the window of the image does not count.
  const EndoscopePose* endoscope = nullptr;
};

/// As run() uses it: within arm_limits, and without a window of the image where the endoscope moves.
ControllerConfig controller_of(const RunConfig& config);

/// One control tick: what the loop went by, what it decided, and the image that came, if one did.
struct ControlTick {
  ServoInput input;
  ServoDecision decision;
  std::optional<TrackedImage> seen;  ///< without q and r where the joints contradict them
  bool pursues_tip = false;          ///< the goal is of the tip: its features are those of the registration
  /// Where a goal of the tip was pursued when `seen` was exposed: the seen tip beside it, ideal pixels.
  std::optional<Eigen::Vector2d> tip_error_px{};
  double trajectory_s = 0;  ///< the trajectory's time, which stands while the supervisor or the loop holds the arm
};

/// Receives every tick after its setpoints were sent, in the loop's thread: a long computation here only delays the
/// next tick.
class RunObserver {
 public:
  virtual ~RunObserver() = default;
  /// False ends the run.
  virtual bool on_tick(const ControlTick& tick) = 0;
};

/// The servo loop: reads the joints, measures, decides, sends, then calls the observer, once every
/// ControllerConfig::period_s for `duration_s`; then, and whenever an exception ends it, lets the arm brake to rest. An
/// exception of a port meanwhile is thrown after that, unless another one ended the loop. A missing or stale image, a
/// lost marker, an outlier or a number that is not finite make it hold within the tick; it continues by itself when the
/// cause ends within SupervisorConfig::max_loop_hold_s. After anything else it holds until a start (see
/// SupervisorState), and then until an image shows the instrument. A late tick shifts none of those after it. The
/// trajectory begins when the loop moves the arm first, and its time stands while the supervisor or the loop holds the
/// arm, however shortly: the arm goes on where it left the path; `duration_s` runs on. Where the endoscope moves it
/// releases the arm, measures camera_from_rcm anew from motion that the operator makes, and continues after a start.
///
/// Throws InputError before anything moves: without RunConfig::arm_limits where the arm is not simulated; for a
/// duration or a clock's time that is not finite; for joints or a first image stamped more than a second ahead of the
/// clock; and, as soon as the arm is not held until a start and its joints are known, for a trajectory that can't be
/// followed from there (refuse_infeasible()), unless nothing is moved: the arm is simulated and does not follow; or for
/// a goal of the tip that can't be reached, with the nearest place that can.
///
/// A goal of the tip needs the rig's camera_from_rcm and tool. Across the line of sight the image closes it: in steady
/// state the image of the tip, by the seen marker, lies on the goal's. Along it, in depth, the registration counts.
void run(Supervisor& arm, ImageStream& images, Clock& clock, const RunConfig& config, const Trajectory& trajectory,
         double duration_s, RunObserver& observer);

/// With a Supervisor of its own: this call is the first start, JointState::started every other.
void run(Robot& robot, ImageStream& images, Clock& clock, const RunConfig& config, const Trajectory& trajectory,
         double duration_s, RunObserver& observer);

}  // namespace lapservo
