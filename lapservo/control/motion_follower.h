#pragma once

#include <optional>

#include "lapservo/control/calibration_motion.h"
#include "lapservo/core/joint_vector.h"
#include "lapservo/robot/joint_path.h"

namespace lapservo::internal {

/// Leads an arm along a motion, within the rate, acceleration and position limits. Where it ends nothing more is to be
/// sent: the last path brakes by itself.
class MotionFollower {
 public:
  enum class Progress {
    moving,
    done,             ///< from here on the motion has ended
    does_not_follow,  ///< its joints stayed farther than max_lead from the setpoints, which have returned to them
  };

  /// At rest where the motion begins. `max_lead`: of each joint, rad and m.
  MotionFollower(JointMotion motion, const JointLimits& limits, const Eigen::Vector4d& max_lead, double now_s);

  /// Call it about every `period_s`. Send `path` where it is present.
  struct Step {
    Progress progress = Progress::moving;
    std::optional<JointPath> path{};
  };
  Step step(double now_s, const JointVector& measured);
  /// Goes on at rest from there, with what is left of the motion: nothing could be sent since the last step.
  void resume(double now_s, const JointVector& measured);

  static constexpr double period_s = 0.01;

 private:
  Step retreat(double now_s);
  Step send(double now_s, const Eigen::Vector4d& wanted_velocity);

  JointMotion motion_;
  JointLimits limits_;
  Eigen::Vector4d max_lead_;
  JointPath path_;
  double started_s_;  // what was waited for left out
  double last_s_;
  int far_ = 0;  // readings at a stretch
  struct Retreat {
    Eigen::Vector4d to;
    double until_s;
  };
  std::optional<Retreat> retreat_;
};

}  // namespace lapservo::internal
