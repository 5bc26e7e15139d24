#include "lapservo/control/arm_response.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <Eigen/Cholesky>

namespace lapservo::internal {
namespace {

constexpr double forgetting_s = 10;  // of motion
constexpr double max_lag_s = 0.1;
constexpr double min_friction = 1e-3, max_friction = 0.1, max_load = 1;  // joint scales

}  // namespace

void ArmResponse::restart() {
  started_ = asked_ = false;
  drive_.load.setZero();
  drive_.load_known.fill(false);
  standing_load_.setZero();
  // The estimates of lag and friction stay: they do not depend on the load's value.
  normal_.middleRows<4>(1).setZero();
  normal_.middleCols<4>(1).setZero();
  cross_ = normal_ * (Unknowns() << lag_s_, drive_.load, drive_.friction.cwiseQuotient(scales_.joints)).finished();
}

// The motor of a blocked joint winds up the transmission: the joint moves a small part of the way, and moves on a
// little after the setpoint has come to rest.
bool ArmResponse::follows(int joint, double setpoint_velocity) const {
  constexpr double nearly = 0.7;
  const double slowest = 0.02 * scales_.joints[joint];  // per second
  const double side = setpoint_velocity > 0 ? 1 : -1;
  const double enough =
      std::max({slowest, nearly * side * setpoint_velocity, nearly * side * smooth_setpoint_velocity_[joint]});
  return side * smooth_velocity_[joint] > enough && side * drive_.velocity[joint] > enough;
}

void ArmResponse::add(const MotionState& setpoint, const Eigen::Vector4d& q_joint, double interval_s) {
  constexpr double smoothing_s = 0.05;
  if (started_ && interval_s > 0) {
    drive_.velocity = (q_joint - q_before_) / interval_s;
    const double weight = -std::expm1(-interval_s / smoothing_s);
    smooth_velocity_ += weight * (drive_.velocity - smooth_velocity_);
    smooth_setpoint_velocity_ += weight * (setpoint.velocity - smooth_setpoint_velocity_);
  } else {
    drive_.velocity.setZero();
    smooth_velocity_.setZero();
    smooth_setpoint_velocity_.setZero();
  }
  q_before_ = q_joint;
  started_ = true;
  asked_ = asked_ || !setpoint.velocity.isZero(0);
  bool told = false;
  for (int i = 0; i < 4; ++i) {
    bool& follows_now = drive_.follows[static_cast<std::size_t>(i)];
    follows_now = follows(i, setpoint.velocity[i]);
    if (!follows_now) {
      // An arm without a commanded motion hangs in its present place.
      const double most = max_load * scales_.joints[i];
      if (!asked_) drive_.load[i] = standing_load_[i] = std::clamp(setpoint.position[i] - q_joint[i], -most, most);
      continue;
    }
    if (!told) {
      const double kept = std::exp(-interval_s / forgetting_s);
      normal_ *= kept, cross_ *= kept, rising_s_ *= kept, falling_s_ *= kept;
      told = true;
    }
    const double side = setpoint.velocity[i] > 0 ? 1 : -1;
    Unknowns row = Unknowns::Zero();
    row[0] = drive_.velocity[i] / scales_.joints[i];
    row[1 + i] = 1;
    row[5 + i] = side;
    normal_ += interval_s * row * row.transpose();
    cross_ += interval_s * (setpoint.position[i] - q_joint[i]) / scales_.joints[i] * row;
    (side > 0 ? rising_s_ : falling_s_)[i] += interval_s;
  }
  if (told) solve();
}

void ArmResponse::solve() {
  // Pulls to 0 what has hardly been seen: the lag until the arm has moved about a tenth of the joint scale.
  constexpr double little = 1e-2, enough_s = 0.1;
  Eigen::Matrix<double, unknowns, unknowns> normal = normal_;
  normal.diagonal().array() += little;
  Unknowns cross = cross_;
  cross.segment<4>(1) += little * standing_load_.cwiseQuotient(scales_.joints);
  const Unknowns found = normal.llt().solve(cross);
  lag_s_ = std::clamp(found[0], 0.0, max_lag_s);
  for (int i = 0; i < 4; ++i) {
    const bool both_ways = std::min(rising_s_[i], falling_s_[i]) > enough_s;
    drive_.load_known[static_cast<std::size_t>(i)] = both_ways && normal_(1 + i, 1 + i) > enough_s;
    if (has_moved(i)) drive_.load[i] = scales_.joints[i] * std::clamp(found[1 + i], -max_load, max_load);
    const bool plain = both_ways && found[5 + i] > min_friction;
    drive_.friction[i] = plain ? scales_.joints[i] * std::min(found[5 + i], max_friction) : 0;
  }
}

}  // namespace lapservo::internal
