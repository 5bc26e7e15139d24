#include "lapservo/control/following_error_limit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "lapservo/control/gap_crossing.h"

namespace lapservo::internal {

void FollowingErrorLimit::update(const MotionState& setpoint, const Eigen::Vector4d& q_joint, const DriveState& drive,
                                 double lag_s, double interval_s) {
  constexpr double nearly = 0.9;
  constexpr double known = 0.9, unknown = 0.7, least_lag_s = 0.02;  // an arm lags at least by about this
  drive_ = drive;
  const double lag_or_least_s = std::max(lag_s, least_lag_s);
  const bool restarted = std::exchange(restarted_, false);
  bool at_end = false;
  for (int i = 0; i < 4; ++i) {
    const auto joint = static_cast<std::size_t>(i);
    const double times = drive.load_known[joint] ? known : unknown;
    allowed_[i] = times * lag_or_least_s * limits_.rate[i] + drive.friction[i];
    const double lead = setpoint.position[i] - q_joint[i] - drive.load[i], side = lead > 0 ? 1 : -1;
    if (restarted) beyond_[i] = lead;
    if (side * lead - allowed_[i] <= 0) {
      beyond_[i] = 0;
    } else if (drive.follows[joint]) {
      const double v = setpoint.velocity[i];
      beyond_[i] = lead - lag_s * v - std::copysign(drive.friction[i], v);
    }
    ahead_[i] = lead - beyond_[i];
    at_end |= std::abs(ahead_[i]) > nearly * allowed_[i] && !drive.follows[joint];
  }
  reached_s_ = at_end ? reached_s_ + interval_s : 0;
}

bool FollowingErrorLimit::is_reached() const {
  constexpr double some_s = 0.3;
  return reached_s_ > some_s;
}

VelocityRange FollowingErrorLimit::range(const Eigen::Vector4d& rate) const {
  VelocityRange range{-rate, rate};
  // The largest speed to one side, at which the lead may grow by so much.
  const auto fastest = [&](Eigen::Index i, double velocity, double left) {
    const double closing = std::copysign(closing_speed(std::abs(left), limits_.acceleration[i]), left);
    return std::clamp(std::max(0.0, velocity) + closing, -rate[i], rate[i]);
  };
  for (Eigen::Index i = 0; i < 4; ++i) {
    if (drive_.follows[static_cast<std::size_t>(i)]) continue;
    range.upper[i] = fastest(i, drive_.velocity[i], allowed_[i] - ahead_[i]);
    range.lower[i] = -fastest(i, -drive_.velocity[i], allowed_[i] + ahead_[i]);
  }
  return range;
}

}  // namespace lapservo::internal
