#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/trajectory.h"
#include "lapservo/rig/rig.h"
#include "lapservo/servo/servo.h"
#include "lapservo/servo/servo_log.h"
#include "lapservo/servo/site.h"
#include "lapservo/vision/tracker.h"

namespace lapservo {

struct ServoRunConfig {
  Rig rig;  ///< as the loop believes it to be; its first instrument is steered
  ControllerConfig controller;
  std::optional<Eigen::Vector2d> rcm_px;  ///< for r, where the rig has no camera_from_rcm; ideal pixels
  std::optional<Rig> true_rig;            ///< of a simulation, for the truth in the log; else `rig`
  TrackerOptions tracker;
};

/// After each period: what happened, the frame that came (empty when none did) and what was seen in it. False ends the
/// run.
using AfterPeriod = std::function<bool(const ServoRecord&, const cv::Mat& frame, const std::vector<Observation>&)>;

/// See, estimate, control, command: runs the loop at a site for `duration_s`, then brakes. One record a period goes to
/// `after`. A missing or stale image, a lost marker, an outlier, a number that is not finite or an arm that is not
/// enabled make it hold within the period; it goes on by itself when all is well again.
void run_servo(Site& site, const ServoRunConfig& config, const Trajectory& trajectory, double duration_s,
               const AfterPeriod& after);

/// Puts a log's inputs through a servo of the same configuration again. The first period whose decision differs in any
/// bit, or nullopt.
struct ReplayDifference {
  std::size_t period = 0;
  std::string column, logged, replayed;
};
std::optional<ReplayDifference> replay(const std::vector<LoggedPeriod>& log, const ServoRunConfig& config);

}  // namespace lapservo
