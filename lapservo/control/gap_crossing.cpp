#include "lapservo/control/gap_crossing.h"

#include <algorithm>
#include <cmath>

namespace lapservo::internal {

double closing_speed(double left, double acceleration) {
  constexpr double time_constant_s = 0.04;
  const double near = acceleration * time_constant_s * time_constant_s / 2;
  return left < near ? left / time_constant_s : std::sqrt(acceleration * (left - near / 2));
}

Eigen::Vector4d cross_gaps(const JointLimits& limits, const MotionState& motion, const GapState& gap,
                           const DriveState& drive, const Eigen::Vector4d& q_joint, const Eigen::Vector4d& feed_forward,
                           const Eigen::Vector4d& wanted, double period_s) {
  constexpr double following = 0.25;
  constexpr double slow_s = 2;  // motion that takes longer for a gap's width has no direction worth crossing it for
  Eigen::Vector4d velocity = wanted;
  for (int i = 0; i < 4; ++i) {
    const double side = feed_forward[i] > 0 ? 1 : -1;
    if (side * feed_forward[i] * slow_s <= gap.width[i] + 2 * drive.friction[i] || side * wanted[i] <= 0) continue;
    // In the instrument's direction of motion: the setpoint first leads the motor by the friction, then the motor
    // crosses its gap; zero if it presses already.
    const double lead = side * (motion.position[i] - q_joint[i] - drive.load[i]);
    const bool follows = side * drive.velocity[i] > std::max(0.0, side * motion.velocity[i]) * following;
    const double to_motor = std::min(follows ? 0 : 2 * drive.friction[i], drive.friction[i] - lead);
    const double left = gap.width[i] / 2 + side * gap.shift[i] + to_motor;
    if (!(left > 0)) continue;
    const double fastest = std::min(limits.rate[i], side * motion.velocity[i] + limits.acceleration[i] * period_s);
    const double crossing = std::min(side * wanted[i] + closing_speed(left, limits.acceleration[i]), fastest);
    velocity[i] = side * std::max(side * wanted[i], crossing);
  }
  return velocity;
}

}  // namespace lapservo::internal
