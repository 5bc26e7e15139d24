#include "lapservo/control/setpoint_interpolator.h"

#include <algorithm>

namespace lapservo {

void SetpointInterpolator::reset(double time_s, const Eigen::Vector4d& position) {
  start_ = {position, Eigen::Vector4d::Zero()};
  end_velocity_.setZero();
  start_s_ = time_s;
  period_s_ = 0;
}

void SetpointInterpolator::ramp_to(double time_s, const Eigen::Vector4d& velocity, double period_s) {
  start_ = end();
  start_s_ = std::max(time_s, start_s_ + period_s_);
  period_s_ = period_s;
  end_velocity_ = velocity;
}

MotionState SetpointInterpolator::at(double time_s) const {
  if (period_s_ <= 0) return {start_.position, end_velocity_};
  const double passed_s = std::clamp(time_s - start_s_, 0.0, period_s_);
  const Eigen::Vector4d acceleration = (end_velocity_ - start_.velocity) / period_s_;
  return {start_.position + passed_s * (start_.velocity + acceleration * (passed_s / 2)),
          start_.velocity + acceleration * passed_s};
}

}  // namespace lapservo
