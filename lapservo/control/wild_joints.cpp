#include "lapservo/control/wild_joints.h"

namespace lapservo::internal {
namespace {

constexpr int believed_after = 3;
const Eigen::Array4d at_once(0.01, 0.01, 0.001, 0.04);  // rounding, and times that are those of the step

}  // namespace

bool WildJoints::reachable(const Reading& from, const Reading& to) const {
  const Eigen::Array4d way = (to.q - from.q).array().abs();
  return (way <= at_once + 3 * rate_.array() * (to.time_s - from.time_s)).all();
}

WildJoints::Verdict WildJoints::validate(double time_s, const Eigen::Vector4d& q) {
  const Reading now{time_s, q};
  const bool plausible = !started_ || reachable(believed_, now);
  staying_ = plausible ? 0 : staying_ > 0 && reachable(latest_, now) ? staying_ + 1 : 1;
  latest_ = now;
  started_ = true;
  if (!plausible && staying_ < believed_after) return Verdict::wild;
  believed_ = now;
  return plausible ? Verdict::plausible : Verdict::jumped;
}

}  // namespace lapservo::internal
