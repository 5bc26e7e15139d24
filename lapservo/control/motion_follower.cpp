#include "lapservo/control/motion_follower.h"

#include <utility>

#include "lapservo/control/motion_limits.h"

namespace lapservo::internal {
namespace {

constexpr double follow_s = 0.5, retreat_s = 0.1, retreats_for_s = 0.5;
constexpr int far_after = 5;  // one wild reading is none

}  // namespace

MotionFollower::MotionFollower(JointMotion motion, const JointLimits& limits, const Eigen::Vector4d& max_lead,
                               double now_s)
    : motion_(std::move(motion)),
      limits_(limits),
      max_lead_(max_lead),
      path_(limits.acceleration),
      started_s_(now_s),
      last_s_(now_s) {
  path_.reset(now_s, motion_.at(0));
}

MotionFollower::Step MotionFollower::send(double now_s, const Eigen::Vector4d& wanted_velocity) {
  const Eigen::Matrix4d weight = limits_.rate.cwiseAbs2().cwiseInverse().asDiagonal();
  const LimitedVelocity allowed =
      limit_velocity(limits_, std::nullopt, path_.at(now_s), std::nullopt, wanted_velocity, weight, period_s);
  path_.ramp_to(now_s, allowed.velocity, period_s);
  return {Progress::moving, path_};
}

MotionFollower::Step MotionFollower::retreat(double now_s) {
  if (now_s > retreat_->until_s) return {Progress::does_not_follow};
  return send(now_s, (retreat_->to - path_.at(now_s).position) / retreat_s);
}

void MotionFollower::resume(double now_s, const JointVector& measured) {
  started_s_ += now_s - std::exchange(last_s_, now_s);
  path_.reset(now_s, measured.vector());
  far_ = 0;
}

MotionFollower::Step MotionFollower::step(double now_s, const JointVector& measured) {
  last_s_ = now_s;
  const Eigen::Vector4d q = measured.vector();
  if (retreat_) return retreat(now_s);
  const double t = now_s - started_s_;
  if (t > motion_.duration_s + period_s) return {Progress::done};
  const Eigen::Vector4d on_path = path_.at(now_s).position;
  far_ = ((q - on_path).cwiseAbs().array() <= max_lead_.array()).all() ? 0 : far_ + 1;
  if (far_ >= far_after && q.allFinite()) {
    retreat_ = Retreat{q, now_s + retreats_for_s};
    return retreat(now_s);
  }
  const Eigen::Vector4d wanted = motion_.at(t), rate = (motion_.at(t + period_s) - wanted) / period_s;
  return send(now_s, rate + (wanted - on_path) / follow_s);
}

}  // namespace lapservo::internal
