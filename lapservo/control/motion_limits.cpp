#include "lapservo/control/motion_limits.h"

#include <algorithm>

namespace lapservo::internal {

double stopping_time_s(const JointLimits& limits) {
  return limits.rate.cwiseQuotient(limits.acceleration).maxCoeff();
}

Eigen::Vector4d brake(const JointLimits& limits, const Eigen::Vector4d& velocity, double period_s) {
  const double stop_s = velocity.cwiseAbs().cwiseQuotient(limits.acceleration).maxCoeff();
  return stop_s > period_s ? Eigen::Vector4d(velocity * (1 - period_s / stop_s)) : Eigen::Vector4d::Zero();
}

LimitedVelocity limit_velocity(const JointLimits& limits, const std::optional<ImageWindow>& window,
                               const MotionState& motion, const std::optional<EndPoints>& ends,
                               const Eigen::Vector4d& wanted, const Eigen::Matrix4d& weight, double period_s,
                               const std::optional<Eigen::Vector4d>& slower) {
  const Eigen::Vector4d braking = brake(limits, motion.velocity, period_s);
  const double stop_s = stopping_time_s(limits);
  const Eigen::Vector4d rate = limits.rate.cwiseMin(slower.value_or(limits.rate));
  // Largest speed at the end of the period towards a bound that is `gap` away and approached at `speed`.
  const auto approach = [&](double gap, double speed) {
    return (gap - speed * period_s / 2) / (stop_s + period_s / 2);
  };

  HalfSpaces bounds;
  for (int i = 0; i < 4; ++i) {
    const double change = limits.acceleration[i] * period_s;
    const double v = motion.velocity[i];
    const double high = std::min({rate[i], v + change, approach(limits.upper[i] - motion.position[i], v)});
    const double low = std::min({rate[i], -v + change, approach(motion.position[i] - limits.lower[i], -v)});
    bounds.push_back({Eigen::Vector4d::Unit(i), std::max(high, braking[i])});
    bounds.push_back({-Eigen::Vector4d::Unit(i), std::max(low, -braking[i])});
  }
  if (window && ends) {
    const Eigen::Vector4d lower(window->u_min_px, window->v_min_px, window->u_min_px, window->v_min_px);
    const Eigen::Vector4d upper(window->u_max_px, window->v_max_px, window->u_max_px, window->v_max_px);
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector4d row = ends->jacobian.row(i);
      const double speed = row.dot(motion.velocity), least = row.dot(braking);
      bounds.push_back({row, std::max(approach(upper[i] - ends->ends_px[i], speed), least)});
      bounds.push_back({-row, std::max(approach(ends->ends_px[i] - lower[i], -speed), -least)});
    }
  }
  const QpSolution solution = solve_velocity_qp(weight, wanted, bounds, braking);
  return {solution.x, solution.constrained};
}

}  // namespace lapservo::internal
