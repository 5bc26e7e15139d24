#include "lapservo/control/motion_limits.h"

#include <algorithm>
#include <array>
#include <limits>
#include <string_view>

#include <fmt/format.h>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/core/joint_vector.h"

namespace lapservo::internal {

PositionBounds::PositionBounds(const JointLimits& limits, const std::optional<ImageWindow>& window) {
  lower << limits.lower, Eigen::Vector4d::Constant(-std::numeric_limits<double>::infinity());
  upper << limits.upper, Eigen::Vector4d::Constant(std::numeric_limits<double>::infinity());
  if (!window) return;
  lower.tail<4>() << window->u_min_px, window->v_min_px, window->u_min_px, window->v_min_px;
  upper.tail<4>() << window->u_max_px, window->v_max_px, window->u_max_px, window->v_max_px;
}

std::string PositionBounds::text(const PositionLimit& limit) const {
  constexpr std::array<std::string_view, 4> ends{"e0_u_px", "e0_v_px", "e3_u_px", "e3_v_px"};
  const double bound = limit.upper ? upper[limit.of] : lower[limit.of];
  const auto of = static_cast<std::size_t>(limit.of);
  if (of < 4) return fmt::format("limits.{} {} {:.4g}", limit.upper ? "upper" : "lower", JointVector::names[of], bound);
  return fmt::format("field of view: {} {} {:.4g}", limit.upper ? "largest" : "least", ends[of - 4], bound);
}

Stop stop_at(const PositionBounds& bounds, const Scales& scales, const Eigen::Vector4d& position, const EndPoints& ends,
             const Eigen::Vector4d& wanted, const Eigen::Matrix4d& weight) {
  constexpr double near = 0.01, near_px = 1;
  HalfSpaces sides;
  InplaceVector<PositionLimit, 16> limits;  // of the sides
  const auto add = [&](Eigen::Index of, const Eigen::Vector4d& normal, double place, double within) {
    if (bounds.upper[of] - place < within) sides.push_back({normal, 0}), limits.push_back({of, true});
    if (place - bounds.lower[of] < within) sides.push_back({-normal, 0}), limits.push_back({of, false});
  };
  for (Eigen::Index i = 0; i < 4; ++i) {
    add(i, Eigen::Vector4d::Unit(i), position[i], near * scales.joints[i]);
    add(4 + i, ends.jacobian.row(i), ends.ends_px[i], near_px);
  }
  const QpSolution solution = solve_velocity_qp(weight, wanted, sides, Eigen::Vector4d::Zero());
  Stop stop{solution.x};
  if (solution.optimal && solution.constrained) stop.at = limits[solution.strongest];
  return stop;
}

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
                               const VelocityRange& range) {
  const Eigen::Vector4d braking = brake(limits, motion.velocity, period_s);
  const double stop_s = stopping_time_s(limits);
  // Largest speed at the end of the period towards a bound that is `gap` away and approached at `speed`.
  const auto approach = [&](double gap, double speed) {
    return (gap - speed * period_s / 2) / (stop_s + period_s / 2);
  };

  HalfSpaces bounds;
  for (int i = 0; i < 4; ++i) {
    const double change = limits.acceleration[i] * period_s;
    const double v = motion.velocity[i];
    const double high =
        std::min({limits.rate[i], range.upper[i], v + change, approach(limits.upper[i] - motion.position[i], v)});
    const double low =
        std::min({limits.rate[i], -range.lower[i], -v + change, approach(motion.position[i] - limits.lower[i], -v)});
    bounds.push_back({Eigen::Vector4d::Unit(i), std::max(high, braking[i])});
    bounds.push_back({-Eigen::Vector4d::Unit(i), std::max(low, -braking[i])});
  }
  if (window && ends) {
    const PositionBounds places(limits, window);
    const Eigen::Vector4d lower = places.lower.tail<4>(), upper = places.upper.tail<4>();
    for (int i = 0; i < 4; ++i) {
      const Eigen::Vector4d row = ends->jacobian.row(i);
      const double speed = row.dot(motion.velocity), least = row.dot(braking);
      bounds.push_back({row, std::max(approach(upper[i] - ends->ends_px[i], speed), least)});
      bounds.push_back({-row, std::max(approach(ends->ends_px[i] - lower[i], -speed), -least)});
    }
  }
  // Where braking is out of the range, each joint so near to it as the other bounds allow.
  const Eigen::Matrix4d by_rate = limits.rate.cwiseAbs2().cwiseInverse().asDiagonal();
  const Eigen::Vector4d in_range = braking.cwiseMax(range.lower).cwiseMin(range.upper),
                        start = solve_velocity_qp(by_rate, in_range, bounds, braking).x;
  for (Eigen::Index i = 0; i < 4; ++i) {
    HalfSpace* high = bounds.begin() + 2 * i;
    HalfSpace* low = high + 1;
    high->bound = std::min(high->bound, std::max(range.upper[i], start[i]));
    low->bound = std::min(low->bound, std::max(-range.lower[i], -start[i]));
  }
  const QpSolution solution = solve_velocity_qp(weight, wanted, bounds, start);
  return {solution.x, solution.constrained};
}

}  // namespace lapservo::internal
