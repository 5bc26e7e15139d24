#include "lapservo/control/wild_joints.h"

#include <algorithm>

namespace lapservo::internal {
namespace {

constexpr int believed_after = 3;
const Eigen::Array4d at_once(0.01, 0.01, 0.001, 0.04);  // rounding, and times that are those of the step

}  // namespace

bool WildJoints::reachable(const Reading& from, const Reading& to) const {
  const Eigen::Array4d way = (to.q - from.q).array().abs();
  return (way <= at_once + 3 * rate_.array() * (to.time_s - from.time_s)).all();
}

// The joints go on as they went, within what jitter of the times and a released joint make of it.
bool WildJoints::goes_on(const Reading& now) const {
  if (!(interval_s_ > 0)) return true;  // not known how they went
  const double interval_s = now.time_s - believed_.time_s;
  // Time that passes while joints are wild makes them no more plausible.
  const double counted_s = staying_ > 0 ? std::min(interval_s, interval_s_) : interval_s;
  const Eigen::Array4d change = (now.q - believed_.q - interval_s * velocity_).array().abs();
  return (change <= at_once / 2 + counted_s * (rate_ / 2 + velocity_.cwiseAbs()).array()).all();
}

WildJoints::Verdict WildJoints::validate(double time_s, const Eigen::Vector4d& q) {
  const Reading now{time_s, q};
  const bool plausible = !started_ || (reachable(believed_, now) && goes_on(now));
  staying_ = plausible ? 0 : staying_ > 0 && reachable(latest_, now) ? staying_ + 1 : 1;
  latest_ = now;
  if (!started_) believed_ = now;
  started_ = true;
  if (!plausible && staying_ < believed_after) return Verdict::wild;
  velocity_.setZero();
  interval_s_ = 0;
  if (plausible && now.time_s > believed_.time_s) {
    interval_s_ = now.time_s - believed_.time_s;
    velocity_ = (now.q - believed_.q) / interval_s_;
  }
  believed_ = now;
  return plausible ? Verdict::plausible : Verdict::jumped;
}

}  // namespace lapservo::internal
