#include "lapservo/crtk/arm_pose.h"

#include <algorithm>
#include <cmath>

#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/dvrk_frames.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::internal {
namespace {

constexpr double late_s = 0.07, memory_s = 3, by_motion_of_s = 0.05, ahead_s = 0.1;

// The camera's by dVRK's trajectories of an ECM, 30 degrees/s about each of three axes and 60 mm/s along the shaft,
// 0.25 m from the RCM; and the change at once, by stamps that are some milliseconds off.
constexpr double way_m_s = 0.25, turn_rad_s = 0.9, way_at_once_m = 2e-3, turn_at_once_rad = 1e-2;

// `way` along each axis, then `turn` about it.
Eigen::Vector<double, 6> of_axes(double way, double turn) {
  return (Eigen::Vector<double, 6>() << way, way, way, turn, turn, turn).finished();
}

// From one pose on to another by that share of the way, which may be above 1.
Rigid3 between(const Rigid3& from, const Rigid3& to, double share) {
  const Eigen::Vector3d turn = rotation_vector_of(to.rotation * from.rotation.conjugate());
  return {rotation_by(share * turn) * from.rotation, from.translation + share * (to.translation - from.translation)};
}

}  // namespace

ArmPose::ArmPose(Transport& transport, const std::string& arm, const Clock& clock) : clock_(clock), stamps_(late_s) {
  for (const bool local : {true, false})
    subscriptions_.push_back(
        transport.subscribe<PlaceMessage>(topic_of(arm, local ? "local/measured_cp" : "measured_cp"),
                                          [this, local](PlaceMessage&& message) { take(message, local); }));
}

void ArmPose::take(const PlaceMessage& message, bool local) {
  constexpr double plain = 1e-3;  // the norm's rounding
  const auto& [rotation, translation] = message.pose;
  if (!translation.allFinite() || !(std::abs(rotation.norm() - 1) < plain)) return;
  const std::lock_guard lock(mutex_);
  const double arrival_s = clock_.now_s();
  const bool other_topic = local != local_;
  if (other_topic && (local_ || arrival_s - first_s_ > FirstSender::silence_s)) return;
  first_s_ = std::min(first_s_, arrival_s);
  local_ = local;
  if (other_topic) sender_ = {};
  const FirstSender::Verdict verdict = sender_.hear(message.source, arrival_s);
  if (other_topic || verdict == FirstSender::Verdict::counts_anew) stamps_ = StampClock(late_s), forget();
  if (sender_.has_rival(arrival_s)) return forget();
  const StampClock::Reading reading = stamps_.read(message.stamp_s, arrival_s);
  if (reading.verdict != StampVerdict::fresh || (!poses_.empty() && reading.time_s <= poses_.back().time_s)) return;
  const Pose now{reading.time_s, {rotation.normalized(), translation}};
  const WildPoses::Verdict seems = validate(now);
  if (seems == WildPoses::Verdict::wild) return;
  if (seems == WildPoses::Verdict::jumped) poses_.clear();
  poses_.push_back(now);
  while (poses_.back().time_s - poses_.front().time_s > memory_s) poses_.pop_front();
}

void ArmPose::forget() {
  poses_.clear();
  wild_.reset();
}

ArmPose::WildPoses::Verdict ArmPose::validate(const Pose& now) {
  if (!wild_) {
    wild_.emplace(of_axes(way_m_s, turn_rad_s), of_axes(way_at_once_m, turn_at_once_rad));
    first_rotation_ = now.pose.rotation;
  }
  Eigen::Vector<double, 6> reading;
  reading << now.pose.translation, rotation_vector_of(now.pose.rotation * first_rotation_.conjugate());
  return wild_->validate(now.time_s, reading);
}

bool ArmPose::has_two_senders() const {
  const std::lock_guard lock(mutex_);
  return sender_.has_rival(clock_.now_s());
}

std::optional<Rigid3> ArmPose::newest() const {
  const std::lock_guard lock(mutex_);
  const bool may_change = !local_ && clock_.now_s() - first_s_ <= FirstSender::silence_s;
  return poses_.empty() || may_change ? std::nullopt : std::optional(poses_.back().pose);
}

std::optional<Rigid3> ArmPose::at(double time_s) const {
  const std::lock_guard lock(mutex_);
  if (poses_.empty() || time_s < poses_.front().time_s || time_s > poses_.back().time_s + ahead_s) return std::nullopt;
  const auto first_after = [this](double than_s) {
    return std::upper_bound(poses_.begin(), poses_.end(), than_s,
                            [](double at_s, const Pose& pose) { return at_s < pose.time_s; });
  };
  auto to = first_after(time_s);
  auto from = to;
  if (to != poses_.end()) {
    --from;
  } else {
    from = first_after(poses_.back().time_s - by_motion_of_s), --to;
    if (from != poses_.begin()) --from;
  }
  if (from == to) return to->pose;
  return between(from->pose, to->pose, (time_s - from->time_s) / (to->time_s - from->time_s));
}

bool HeldEndoscope::begin() {
  const auto pose = arm_.newest();
  if (pose) first_from_base_ = (*pose * dvrk_from_camera()).inverse();
  return pose.has_value();
}

std::optional<Rigid3> HeldEndoscope::first_from_camera(double time_s) const {
  const auto pose = arm_.at(time_s);
  if (!pose || !first_from_base_) return std::nullopt;
  return *first_from_base_ * *pose * dvrk_from_camera();
}

}  // namespace lapservo::internal
