#pragma once

#include <Eigen/Core>

#include "lapservo/control/feature_model.h"
#include "lapservo/control/motion_limits.h"

namespace lapservo::internal {

/// How far the arm lags behind its setpoints, in seconds: least squares of setpoint - reading = lag * velocity over the
/// last seconds of motion. The desired motion is fed forward that much earlier.
class ArmLag {
 public:
  explicit ArmLag(const Scales& scales) : scales_(scales) {}

  void add(const MotionState& setpoint, const Eigen::Vector4d& q_joint, double interval_s);
  /// 0 before there was motion; never more than 0.1 s.
  double seconds() const;

 private:
  Scales scales_;
  double cross_ = 0, square_ = 0;
};

}  // namespace lapservo::internal
