#include "lapservo/control/visual_controller.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/control/gap_crossing.h"
#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {
namespace {

TrackingGains exact_gains(const ControllerConfig& config) {
  TrackingGains gains;
  for (int i = 0; i < 4; ++i) gains.per_s[i] = exact_gain_ramped(config.gains.per_s[i], config.period_s);
  return gains;
}

bool all_finite(const DesiredFeatures& desired) {
  return desired.features.allFinite() && desired.rate.allFinite() && desired.acceleration.allFinite();
}

bool all_finite(const ImageMeasurement& image) {
  return std::isfinite(image.time_s) &&
         (!image.found || (image.features.allFinite() && image.covariance.allFinite() && image.ends_px.allFinite() &&
                           (!image.q || image.q->allFinite()))) &&
         (!image.camera_from_marker ||
          (image.camera_from_marker->translation.allFinite() &&
           image.camera_from_marker->rotation.coeffs().allFinite() && image.ends_px.allFinite()));
}

}  // namespace

VisualController::VisualController(const ControllerConfig& config, FeatureModel model)
    : config_(checked(config)),
      exact_gains_(exact_gains(config)),
      joint_weight_(config.scales.joints.cwiseAbs2().cwiseInverse().asDiagonal()),
      estimator_(make_estimator(config, std::move(model))),
      arm_response_(config.scales),
      following_error_limit_(config.limits),
      frozen_image_(config.scales),
      image_response_(config),
      error_growth_(config.scales),
      limited_goal_(config.scales),
      wild_joints_(config.limits.rate),
      path_(config.limits.acceleration) {}

void VisualController::reset(double time_s, const Eigen::Vector4d& q_joint) {
  path_.reset(time_s, q_joint);
  arm_response_.restart();
  following_error_limit_.restart();
  estimator_->restart_probing();
  now_s_ = time_s;
  started_ = true;
}

void VisualController::start_over(double time_s, const Eigen::Vector4d& q_joint) {
  const DriveState drive = arm_response_.drive();
  const Eigen::Vector4d position = q_joint + drive.load;
  const Eigen::Vector4d lower = config_.limits.lower.cwiseMin(q_joint), upper = config_.limits.upper.cwiseMax(q_joint);
  path_.reset(time_s, position.cwiseMax(lower).cwiseMin(upper));
  following_error_limit_ = FollowingErrorLimit(config_.limits);
  now_s_ = time_s;
}

void VisualController::restart_tests() {
  image_response_.restart();
  error_growth_.restart();
  limited_goal_.restart();
  estimator_->restart_tests();
  until_start_ = HoldReason::none;
}

void VisualController::resume(const FeatureModel& model) {
  resume();
  image_response_.interrupt();
  error_growth_.restart();
  limited_goal_.restart();
  estimator_->set_model(model);
  image_reason_ = HoldReason::no_image_yet;
}

ControlStep VisualController::step(double time_s, const Eigen::Vector4d& q_joint,
                                   const std::optional<ImageMeasurement>& image, const DesiredFeatures& desired,
                                   std::span<const JointReading> readings) {
  ControlStep step;
  const bool timed = std::isfinite(time_s) && (!started_ || time_s > now_s_);
  step.reason = read(time_s, q_joint, desired, readings);
  if (timed && q_joint.allFinite()) {
    if (image) image_reason_ = update(*image);
    stale_ = now_s_ - usable_s_ > config_.stale_after_s;
    if (stale_ && image_reason_ == HoldReason::none) image_reason_ = HoldReason::stale_image;
    if (suspended_ == HoldReason::none) step.estimate = estimator_->at(time_s, q_joint);
  }
  if (step.reason == HoldReason::none) step.reason = by_their_rate(image_reason_);
  if (step.reason == HoldReason::none && !(image_s_ >= needed_since_s_)) step.reason = HoldReason::stale_image;
  if (follows_ && step.reason == HoldReason::none && suspended_ == HoldReason::none) step.reason = until_start_;
  if (step.reason == HoldReason::image_not_following) step.unanswered = image_response_.unanswered();
  if (step.reason == HoldReason::error_grows) step.stops_at = grows_at_;

  const Law law = decide(step.reason, q_joint, step.estimate, desired);
  step.reason = law.reason;
  step.velocity = brake(config_.limits, path_.at(now_s_).velocity, config_.period_s);
  if (step.estimate && all_finite(desired)) step.error = feature_error(step.estimate->features, desired.features);
  if (step.reason == HoldReason::none && law.action == ControlAction::track && follows_) {
    const Eigen::Matrix4d& jacobian = step.estimate->jacobian;
    if (law.stop.at) stops_at_ = law.stop.at;
    const bool stopped =
        limited_goal_.add(desired, step.error, jacobian * law.velocity, jacobian * (law.velocity - law.stop.left),
                          jacobian * path_.at(now_s_).velocity, config_.period_s);
    if (stopped && law.stop.at) step.stops_at = law.stop.at, step.reason = HoldReason::goal_beyond_limit;
  }
  if (step.reason == HoldReason::none) {
    limit(law, q_joint, step);
  } else if (measured_) {
    step.velocity = limited_hold(step.velocity);
  }
  if (step.action == ControlAction::probe) estimator_->advance_probing(config_.period_s);

  // Without a time to start from, the path is left to brake by itself when the period before ends.
  if (timed && started_) path_.ramp_to(now_s_, step.velocity, config_.period_s);
  step.has_setpoint = started_;
  step.setpoint = path_.end();
  step.delay_s = delay_s();
  step.delay_is_known = delay_is_known();
  const bool tracks = step.action == ControlAction::track && step.estimate;
  if (!follows_ || (!tracks && suspended_ == HoldReason::none)) {
    error_growth_.restart();
  } else if (tracks && error_growth_.add(desired, step.error)) {
    until_start_ = HoldReason::error_grows;
    grows_at_ = limited_goal_.is_limited() ? stops_at_ : std::nullopt;
  }
  return step;
}

HoldReason VisualController::read(double time_s, const Eigen::Vector4d& q_joint, const DesiredFeatures& desired,
                                  std::span<const JointReading> readings) {
  measured_ = false;
  if (!std::isfinite(time_s)) return HoldReason::non_finite;
  if (started_ && !(time_s > now_s_)) return HoldReason::bad_time;
  const double interval_s = started_ ? time_s - now_s_ : 0;
  now_s_ = time_s;
  if (!q_joint.allFinite()) return HoldReason::non_finite;
  if (!started_) reset(time_s, q_joint);
  auto verdict = joints_are_wild_ ? WildJoints::Verdict::wild : WildJoints::Verdict::plausible;
  // A tick without a new reading does not show how fast a joint goes.
  if (!has_readings_ || !readings.empty() || q_joint != q_read_)
    verdict = wild_joints_.validate(readings.empty() ? time_s : std::min(time_s, readings.back().time_s), q_joint);
  q_read_ = q_joint;
  joints_are_wild_ = verdict == WildJoints::Verdict::wild;
  if (joints_are_wild_) return HoldReason::wild_joints;
  if (verdict == WildJoints::Verdict::jumped) {
    history_.clear();
    estimator_->interrupt();
    arm_response_.restart();
    following_error_limit_.restart();
    frozen_image_ = FrozenImage(config_.scales);
    image_response_.interrupt();
    image_reason_ = HoldReason::wild_joints;  // until an image gives the instrument's place
  }
  if (!follows_) path_.move_to(time_s, q_joint);
  const MotionState setpoint = path_.at(time_s);
  if (follows_) arm_response_.add(setpoint, q_joint, interval_s);
  following_error_limit_.update(setpoint, q_joint, arm_response_.drive(), arm_response_.lag_s(), interval_s);
  remember(time_s, q_joint, readings);
  measured_ = true;
  if (desired.hold == HoldReason::none && !all_finite(desired)) return HoldReason::non_finite;
  const Eigen::Array4d behind = (setpoint.position - q_joint).array().abs();
  const bool far = (behind > config_.max_following_error.array()).any();
  return far || following_error_limit_.is_reached() ? HoldReason::not_following : HoldReason::none;
}

void VisualController::remember(double time_s, const Eigen::Vector4d& q_joint, std::span<const JointReading> readings) {
  for (const JointReading& reading : readings) {
    const Eigen::Vector4d q = reading.q.vector();
    if (!(reading.time_s <= time_s) || !q.allFinite() || !wild_joints_.reaches(reading.time_s, q)) continue;
    history_.push(reading.time_s, q);
    has_readings_ = true;
  }
  // Joints that were read some time before the tick, under its later time, would keep the next reading out.
  if (!has_readings_ || history_.size() == 0) history_.push(time_s, q_joint);
}

HoldReason VisualController::update(const ImageMeasurement& image) {
  if (!all_finite(image)) return HoldReason::non_finite;
  const bool suspended = suspended_ != HoldReason::none;
  if (!image.found && !(suspended && image.camera_from_marker)) return HoldReason::marker_lost;
  if (now_s_ - image.time_s > config_.max_image_age_s) return HoldReason::stale_image;
  constexpr double most_ahead_s = 1;  // by another clock; all images after it would be older
  if (image.time_s - now_s_ > most_ahead_s) return HoldReason::bad_time;
  // A repeated or older stamp carries no information: the age of the last measurement goes on growing.
  if (image_s_ && image.time_s <= *image_s_) return image_reason_;
  // Images that a pause kept back may carry the times at which they arrived.
  if (image_s_ && image.time_s - *image_s_ > config_.stale_after_s) images_from_s_ = image.time_s;
  image_s_ = image.time_s;
  constexpr double compared_s = 0.3;
  const bool joints_pause = history_.pauses(image.time_s - compared_s, image.time_s);
  if (joints_pause) frozen_image_ = FrozenImage(config_.scales);
  if (joints_pause || (images_from_s_ && image.time_s - *images_from_s_ < compared_s)) image_response_.interrupt();
  const FrozenImage::Verdict verdict = frozen_image_.add(image, history_);
  if (verdict == FrozenImage::Verdict::frozen) return HoldReason::frozen_image;
  if (verdict == FrozenImage::Verdict::again) return image_reason_;
  const bool probed = estimator_->probing_velocity(0).has_value();
  const HoldReason reason = suspended ? HoldReason::none : estimator_->update(image, history_);
  // A probing motion ends when the image has shown each joint's.
  if (probed && reason == HoldReason::none && !estimator_->probing_velocity(0)) image_response_.confirm_all();
  if (reason == HoldReason::none) {
    slow_images_.add(stale_);
    usable_s_ = now_s_;
  }
  if (reason == HoldReason::delay_not_found) until_start_ = reason;
  // A suspicion that ends by itself ends no path over which the image has to answer.
  if (suspended || reason == HoldReason::outlier) return reason;
  if (const auto found = estimator_->unanswered()) image_response_.set_unanswered(*found);
  if (const auto now = estimator_->at(now_s_, *history_.newest())) image_response_.add(image, now->jacobian, history_);
  if (image_response_.unanswered()) until_start_ = HoldReason::image_not_following;
  return reason;
}

// The next image is soon here, and would be stale again before the one after it.
HoldReason VisualController::by_their_rate(HoldReason reason) const {
  const bool soon = now_s_ - usable_s_ < 10 * config_.stale_after_s;
  const bool usable = reason == HoldReason::none || (reason == HoldReason::stale_image && soon);
  return usable && slow_images_.are_slow() ? HoldReason::slow_images : reason;
}

VisualController::Law VisualController::decide(HoldReason reason, const Eigen::Vector4d& q_joint,
                                               const std::optional<Estimate>& estimate,
                                               const DesiredFeatures& desired) const {
  if (reason != HoldReason::none || suspended_ != HoldReason::none)
    return {.reason = reason == HoldReason::none ? suspended_ : reason};
  if (desired.hold != HoldReason::none) return {.reason = desired.hold};
  const auto probing_velocity = estimator_->probing_velocity(config_.period_s);
  Law law = probing_velocity ? Law{.action = ControlAction::probe,
                                   .velocity = *probing_velocity,
                                   .rate = config_.limits.rate,
                                   .weight = joint_weight_}
                             : tracking_law(estimate, desired);
  if (!law.velocity.allFinite() || !law.weight.allFinite()) law.reason = HoldReason::non_finite;
  if (law.reason == HoldReason::none) slow(law, q_joint, estimate);
  return law;
}

VisualController::Law VisualController::tracking_law(const std::optional<Estimate>& estimate,
                                                     const DesiredFeatures& desired) const {
  if (!estimate) return {.reason = HoldReason::not_modelled};
  const DampedInverse damped = damped_inverse(estimate->jacobian, config_.scales, config_.damping_threshold);
  if (!(damped.min_singular_value >= config_.min_singular_value)) return {.reason = HoldReason::singular};
  Law law;
  law.rate = image_response_.rate();
  // Deviations count by what they do to the features; a little by the joints', so that it is positive definite.
  const Eigen::Matrix4d scaled = config_.scales.features.cwiseInverse().asDiagonal() * estimate->jacobian;
  law.weight = scaled.transpose() * scaled + joint_weight_;
  if (config_.mode == ControlMode::paper) {
    law.velocity =
        paper_velocity(estimate->jacobian, config_.gains, estimate->features, desired.features, desired.rate);
    return law;
  }
  // The velocity is reached when the period ends, and by the arm a little later: feed forward what is desired then.
  const double lead_s = config_.period_s + arm_response_.lag_s();
  const Eigen::Vector4d rate = desired.rate + lead_s * desired.acceleration;
  // Gain x error of the delay below 1/e does not overshoot.
  constexpr double careful = 0.4;
  TrackingGains gains = exact_gains_;
  if (!estimator_->delay_is_known()) gains.per_s *= careful;
  law.velocity = damped.inverse * wanted_feature_rate(gains, estimate->features, desired.features, rate);
  law.feed_forward = damped.inverse * rate;
  return law;
}

// Slower along the same line, so that a far goal is approached straight. A joint at its limit slows no other.
void VisualController::slow(Law& law, const Eigen::Vector4d& q_joint, const std::optional<Estimate>& estimate) const {
  const Eigen::Vector4d position = path_.at(now_s_).position;
  if (estimate) {
    const Eigen::Matrix4d& jacobian = estimate->ends_jacobian;
    law.ends = EndPoints{estimate->ends_px + jacobian * (position - q_joint), jacobian};
  }
  law.stop = stop_at({config_.limits, config_.window}, config_.scales, position, law.ends.value_or(EndPoints()),
                     law.velocity, law.weight);
  const double times = law.stop.left.cwiseAbs().cwiseQuotient(law.rate).maxCoeff();
  law.is_slowed = times > 1;
  if (law.is_slowed) law.velocity /= times, law.stop.left /= times;
}

/// The law's velocity, as far as the limits allow it.
void VisualController::limit(const Law& law, const Eigen::Vector4d& q_joint, ControlStep& step) const {
  const MotionState motion = path_.at(now_s_);
  // Limits of position may take a motion of any size. A bounded part of it has the same effect and keeps the QP exact.
  constexpr double most_rates = 1e3;
  const Eigen::Vector4d taken = law.velocity - law.stop.left;
  const double rates = taken.cwiseAbs().cwiseQuotient(law.rate).maxCoeff();
  Eigen::Vector4d wanted = law.stop.left + taken / std::max(1.0, rates / most_rates);
  if (step.estimate) {
    JointLimits confirmed = config_.limits;
    confirmed.rate = confirmed.rate.cwiseMin(law.rate);
    wanted = cross_gaps(confirmed, motion, step.estimate->gap, arm_response_.drive(), q_joint, law.feed_forward, wanted,
                        config_.period_s);
  }
  const auto limited = limit_velocity(config_.limits, config_.window, motion, law.ends, wanted, law.weight,
                                      config_.period_s, following_error_limit_.range(law.rate));
  if (!limited.velocity.allFinite()) {
    step.reason = HoldReason::non_finite;
    return;
  }
  step.velocity = limited.velocity;
  step.limited = limited.limited || law.is_slowed;
  step.action = law.action;
}

/// Brakes, except where setpoints have to come back to a joint that did not follow.
Eigen::Vector4d VisualController::limited_hold(const Eigen::Vector4d& braking) const {
  return limit_velocity(config_.limits, {}, path_.at(now_s_), {}, braking, joint_weight_, config_.period_s,
                        following_error_limit_.range(config_.limits.rate))
      .velocity;
}

}  // namespace lapservo::internal
