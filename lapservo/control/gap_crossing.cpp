#include "lapservo/control/gap_crossing.h"

#include <algorithm>
#include <cmath>

namespace lapservo::internal {
namespace {

/// Speed at a distance from the gap's end: slows down at half the acceleration, and the last part exponentially.
double crossing_speed(double left, double acceleration) {
  constexpr double time_constant_s = 0.04;
  const double near = acceleration * time_constant_s * time_constant_s / 2;
  return left < near ? left / time_constant_s : std::sqrt(acceleration * (left - near / 2));
}

}  // namespace

Eigen::Vector4d cross_gaps(const JointLimits& limits, const MotionState& motion, const GapState& gap,
                           const Eigen::Vector4d& q_joint, const Eigen::Vector4d& feed_forward,
                           const Eigen::Vector4d& wanted, double period_s) {
  constexpr double slow_s = 2;  // motion that takes longer for a gap's width has no direction worth crossing it for
  Eigen::Vector4d velocity = wanted;
  for (int i = 0; i < 4; ++i) {
    const double side = feed_forward[i] > 0 ? 1 : -1;
    if (side * feed_forward[i] * slow_s <= gap.width[i] || side * wanted[i] <= 0) continue;
    // To where the motor presses again: from the setpoint, which leads the motor; nothing if the motor presses already.
    const double from_motor = gap.width[i] / 2 + side * gap.shift[i];
    const double left = from_motor - std::max(0.0, side * (motion.position[i] - q_joint[i]));
    if (!(left > 0)) continue;
    const double fastest = std::min(limits.rate[i], side * motion.velocity[i] + limits.acceleration[i] * period_s);
    const double crossing = std::min(side * wanted[i] + crossing_speed(left, limits.acceleration[i]), fastest);
    velocity[i] = side * std::max(side * wanted[i], crossing);
  }
  return velocity;
}

}  // namespace lapservo::internal
