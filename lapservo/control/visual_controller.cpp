#include "lapservo/control/visual_controller.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "lapservo/control/gap_crossing.h"
#include "lapservo/control/motion_limits.h"
#include "lapservo/control/newton_inverse.h"
#include "lapservo/core/error.h"

namespace lapservo {
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
                           (!image.q || image.q->allFinite())));
}

HoldReason reason_of(Update update) {
  switch (update) {
    case Update::accepted:
    case Update::reacquired:
      return HoldReason::none;
    case Update::outlier:
      return HoldReason::outlier;
    case Update::no_history:
      return HoldReason::no_history;
    case Update::not_modelled:
      return HoldReason::not_modelled;
    case Update::non_finite:
      return HoldReason::non_finite;
  }
  return HoldReason::non_finite;
}

}  // namespace

std::string_view action_word(ControlAction action) {
  switch (action) {
    case ControlAction::track:
      return "track";
    case ControlAction::probe:
      return "probe";
    case ControlAction::hold:
      return "hold";
  }
  return "";
}

std::string_view reason_word(HoldReason reason) {
  switch (reason) {
    case HoldReason::none:
      return "none";
    case HoldReason::no_image_yet:
      return "no_image_yet";
    case HoldReason::marker_lost:
      return "marker_lost";
    case HoldReason::stale_image:
      return "stale_image";
    case HoldReason::outlier:
      return "outlier";
    case HoldReason::no_history:
      return "no_history";
    case HoldReason::not_modelled:
      return "not_modelled";
    case HoldReason::singular:
      return "singular";
    case HoldReason::not_following:
      return "not_following";
    case HoldReason::not_learnt:
      return "not_learnt";
    case HoldReason::bad_time:
      return "bad_time";
    case HoldReason::non_finite:
      return "non_finite";
  }
  return "";
}

VisualController::VisualController(const ControllerConfig& config, FeatureModel model)
    : config_(checked(config)),
      model_(std::move(model)),
      exact_gains_(exact_gains(config)),
      observer_(config.observer, config.scales),
      jacobian_(config.jacobian, config.scales),
      arm_lag_(config.scales),
      path_(config.limits),
      probing_fit_(config.scales, config.observer.delay_s) {
  if (!model_ && config.mode != ControlMode::uncalibrated) {
    throw InputError("controller", "mode", std::string(mode_word(config.mode)), "a model (camera_from_rcm in the rig)");
  }
}

void VisualController::reset(double time_s, const Eigen::Vector4d& q_joint) {
  path_.reset(time_s, q_joint);
  now_s_ = time_s;
  usable_s_ = time_s;
  started_ = true;
}

double VisualController::delay_s() const {
  if (config_.observer.delay_s) return *config_.observer.delay_s;
  return config_.mode == ControlMode::uncalibrated ? learnt_delay_s_ : observer_.delay_s();
}

ControlStep VisualController::step(double time_s, const Eigen::Vector4d& q_joint,
                                   const std::optional<ImageMeasurement>& image, const DesiredFeatures& desired) {
  ControlStep step;
  const bool timed = std::isfinite(time_s) && (!started_ || time_s > now_s_);
  step.reason = read(time_s, q_joint, desired);
  const bool readable = timed && q_joint.allFinite();
  if (readable && image) image_reason_ = look(time_s, *image);
  if (readable && time_s - usable_s_ > config_.stale_after_s && image_reason_ == HoldReason::none) {
    image_reason_ = HoldReason::stale_image;
  }
  if (step.reason == HoldReason::none) step.reason = image_reason_;
  if (readable) step.estimate = estimate(time_s, q_joint);

  Law law;
  if (step.reason == HoldReason::none) law = probing() ? probing_law() : this->law(step.estimate, desired);
  if (step.reason == HoldReason::none) step.reason = law.reason;
  if (!law.velocity.allFinite() || !law.weight.allFinite()) step.reason = HoldReason::non_finite;

  const MotionState motion = path_.at(now_s_);
  step.velocity = brake(config_.limits, motion.velocity, config_.period_s);
  if (step.reason == HoldReason::none) {
    std::optional<EndPoints> ends;
    if (step.estimate) {
      ends = {step.estimate->ends_px + step.estimate->ends_jacobian * (motion.position - q_joint),
              step.estimate->ends_jacobian};
    }
    const Eigen::Vector4d slowed = slow_to_rate(law.velocity);
    Eigen::Vector4d wanted = slowed;
    if (step.estimate) {
      wanted =
          cross_gaps(config_.limits, motion, step.estimate->gap, q_joint, law.feed_forward, slowed, config_.period_s);
    }
    const auto limited =
        limit_velocity(config_.limits, config_.window, motion, ends, wanted, law.weight, config_.period_s);
    if (limited.velocity.allFinite()) {
      step.velocity = limited.velocity;
      step.limited = limited.limited || slowed != law.velocity;
      step.action = probing() ? ControlAction::probe : ControlAction::track;
    } else {
      step.reason = HoldReason::non_finite;
    }
  }
  if (step.action == ControlAction::probe) probed_s_ += config_.period_s;
  // Without a time to start from, the path is left to brake by itself when the period before ends.
  if (timed && started_) path_.ramp_to(now_s_, step.velocity, config_.period_s);
  step.has_setpoint = started_;
  step.setpoint = path_.end();
  if (step.estimate && all_finite(desired)) step.error = feature_error(step.estimate->features, desired.features);
  step.delay_s = delay_s();
  return step;
}

HoldReason VisualController::read(double time_s, const Eigen::Vector4d& q_joint, const DesiredFeatures& desired) {
  if (!std::isfinite(time_s)) return HoldReason::non_finite;
  if (started_ && !(time_s > now_s_)) return HoldReason::bad_time;
  if (!q_joint.allFinite()) {
    now_s_ = time_s;
    return HoldReason::non_finite;
  }
  if (!started_) reset(time_s, q_joint);
  const MotionState setpoint = path_.at(time_s);
  arm_lag_.add(setpoint, q_joint, time_s - now_s_);
  history_.push(time_s, q_joint);
  now_s_ = time_s;
  if (!all_finite(desired)) return HoldReason::non_finite;
  const Eigen::Array4d behind = (setpoint.position - q_joint).array().abs();
  return (behind > config_.largest_following_error.array()).any() ? HoldReason::not_following : HoldReason::none;
}

HoldReason VisualController::look(double time_s, const ImageMeasurement& image) {
  if (!all_finite(image)) return HoldReason::non_finite;
  if (!image.found) return HoldReason::marker_lost;
  if (time_s - image.time_s > config_.largest_image_age_s) return HoldReason::stale_image;
  HoldReason reason = HoldReason::none;
  switch (config_.mode) {
    case ControlMode::fused:
      reason = reason_of(observer_.update(model_, history_, image));
      break;
    case ControlMode::paper:
      reason = look_paper(image);
      break;
    case ControlMode::uncalibrated:
      reason = look_uncalibrated(image);
      break;
  }
  if (reason != HoldReason::none) return reason;
  usable_s_ = time_s;
  stamp_s_ = image.time_s;
  return HoldReason::none;
}

/// The paper takes J at the configuration that the features show.
HoldReason VisualController::look_paper(const ImageMeasurement& image) {
  std::optional<NewtonInverse> found;
  if (paper_estimate_) found = newton_inverse(model_, image.features, paper_estimate_->q, config_.scales);
  if ((!found || !found->converged) && image.q) {
    found = newton_inverse(model_, image.features, *image.q, config_.scales);
  }
  if (!found || !found->converged) {
    found = newton_inverse(model_, image.features, *history_.at(now_s_), config_.scales);
  }
  if (!found) return HoldReason::not_modelled;
  const auto state = model_(found->q);
  if (!state) return HoldReason::not_modelled;
  Estimate seen;
  seen.q = found->q;
  seen.features = image.features;
  seen.covariance = image.covariance;
  const Eigen::Matrix4d inverse = damped_inverse(state->jacobian, config_.scales).inverse;
  seen.q_covariance = inverse * image.covariance * inverse.transpose();
  seen.jacobian = state->jacobian;
  seen.ends_px = image.ends_px;
  seen.ends_jacobian = state->ends_jacobian;
  paper_estimate_ = seen;
  return HoldReason::none;
}

HoldReason VisualController::look_uncalibrated(const ImageMeasurement& image) {
  if (!learnt_) {
    if (!probing_motion_) probing_motion_ = ProbingMotion(config_.probing, config_.limits, *history_.at(now_s_));
    probing_fit_.add(image.time_s, image.features, image.ends_px, history_);
    return probed_s_ < probing_motion_->duration_s() ? HoldReason::none : finish_probing();
  }
  const auto q_then = history_.at(image.time_s - delay_s());
  if (!q_then) return HoldReason::no_history;
  const double interval_s = std::max(0.0, image.time_s - stamp_s_);
  const auto update = jacobian_.update(*q_then, image.features, image.ends_px, interval_s);
  return update == JacobianEstimator::Update::accepted ? HoldReason::none : HoldReason::outlier;
}

HoldReason VisualController::finish_probing() {
  const auto model = probing_fit_.solve();
  if (!model) {
    probing_fit_ = ProbingFit(config_.scales, config_.observer.delay_s);
    probing_motion_.reset();
    probed_s_ = 0;
    return HoldReason::not_learnt;
  }
  jacobian_.start(*model);
  learnt_delay_s_ = model->delay_s;
  learnt_ = true;
  return HoldReason::none;
}

std::optional<Estimate> VisualController::estimate(double time_s, const Eigen::Vector4d& q_joint) const {
  if (config_.mode == ControlMode::fused) return observer_.estimate(model_, q_joint, time_s);
  if (config_.mode == ControlMode::paper) return paper_estimate_;
  if (!learnt_) return std::nullopt;
  const FeatureState state = jacobian_.at(q_joint);
  Estimate now;
  now.q = q_joint;
  now.features = state.features;
  now.covariance = config_.scales.features.cwiseAbs2().asDiagonal();
  now.covariance *= jacobian_.variance_at(q_joint);
  now.jacobian = state.jacobian;
  now.ends_px = state.ends_px;
  now.ends_jacobian = state.ends_jacobian;
  return now;
}

VisualController::Law VisualController::law(const std::optional<Estimate>& estimate,
                                            const DesiredFeatures& desired) const {
  Law law;
  if (!estimate) {
    law.reason = HoldReason::not_modelled;
    return law;
  }
  const DampedInverse damped = damped_inverse(estimate->jacobian, config_.scales, config_.damping_threshold);
  if (!(damped.smallest_singular_value >= config_.least_singular_value)) {
    law.reason = HoldReason::singular;
    return law;
  }
  law.weight = deviation_weight(estimate->jacobian);
  if (config_.mode == ControlMode::paper) {
    law.velocity =
        paper_velocity(estimate->jacobian, config_.gains, estimate->features, desired.features, desired.rate);
    return law;
  }
  // The velocity is reached when the period ends, and by the arm a little later: feed forward what is desired then.
  const double lead_s = config_.period_s + arm_lag_.seconds();
  const Eigen::Vector4d rate = desired.rate + lead_s * desired.acceleration;
  law.velocity = damped.inverse * wanted_feature_rate(exact_gains_, estimate->features, desired.features, rate);
  law.feed_forward = damped.inverse * rate;
  return law;
}

VisualController::Law VisualController::probing_law() const {
  Law law;
  law.velocity = probing_motion_->velocity(probed_s_ + config_.period_s);
  law.weight = config_.scales.joints.cwiseAbs2().cwiseInverse().asDiagonal();
  return law;
}

/// Deviations count by what they do to the features; a little by the joints', so that it is positive definite.
Eigen::Matrix4d VisualController::deviation_weight(const Eigen::Matrix4d& jacobian) const {
  const Eigen::Matrix4d scaled = config_.scales.features.cwiseInverse().asDiagonal() * jacobian;
  const Eigen::Matrix4d by_joints = config_.scales.joints.cwiseAbs2().cwiseInverse().asDiagonal();
  return scaled.transpose() * scaled + by_joints;
}

/// Slower along the same line, so that a far goal is approached straight.
Eigen::Vector4d VisualController::slow_to_rate(const Eigen::Vector4d& velocity) const {
  const double times = velocity.cwiseAbs().cwiseQuotient(config_.limits.rate).maxCoeff();
  return times > 1 ? Eigen::Vector4d(velocity / times) : velocity;
}

}  // namespace lapservo
