#include "lapservo/robot/joint_path.h"

#include <algorithm>

namespace lapservo {
namespace {

MotionState after(const MotionState& state, const Eigen::Vector4d& acceleration, double passed_s) {
  return {state.position + passed_s * (state.velocity + acceleration * (passed_s / 2)),
          state.velocity + acceleration * passed_s};
}

}  // namespace

void JointPath::reset(double time_s, const Eigen::Vector4d& position) {
  start_ = {position, Eigen::Vector4d::Zero()};
  end_velocity_.setZero();
  start_s_ = time_s;
  period_s_ = 0;
}

void JointPath::move_to(double time_s, const Eigen::Vector4d& position) {
  end_velocity_ = at(time_s).velocity;
  start_ = {position, end_velocity_};
  start_s_ = time_s;
  period_s_ = 0;
}

void JointPath::ramp_to(double time_s, const Eigen::Vector4d& velocity, double period_s) {
  start_ = at(time_s);
  start_s_ = time_s;
  period_s_ = period_s;
  end_velocity_ = velocity;
}

MotionState JointPath::at(double time_s) const {
  const double passed_s = std::max(0.0, time_s - start_s_);
  if (passed_s < period_s_) return after(start_, (end_velocity_ - start_.velocity) / period_s_, passed_s);
  const MotionState end{start_.position + (start_.velocity + end_velocity_) * (period_s_ / 2), end_velocity_};
  const double stop_s = end_velocity_.cwiseAbs().cwiseQuotient(acceleration_).maxCoeff();
  if (!(stop_s > 0)) return end;
  const double braked_s = passed_s - period_s_;
  if (braked_s >= stop_s) return {end.position + end_velocity_ * (stop_s / 2), Eigen::Vector4d::Zero()};
  return after(end, -end_velocity_ / stop_s, braked_s);
}

}  // namespace lapservo
