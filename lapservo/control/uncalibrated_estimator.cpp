#include "lapservo/control/uncalibrated_estimator.h"

#include <algorithm>

namespace lapservo::internal {

UncalibratedEstimator::UncalibratedEstimator(const ControllerConfig& config)
    : scales_(config.scales),
      limits_(config.limits),
      probing_(config.probing),
      known_delay_s_(config.observer.delay_s),
      jacobian_(config.jacobian, config.scales),
      fit_(config.scales, config.observer.delay_s) {}

HoldReason UncalibratedEstimator::update(const ImageMeasurement& image, const JointHistory& history) {
  HoldReason reason = HoldReason::none;
  if (!learnt_) {
    reason = learn_from_probing(image, history);
  } else {
    const auto q_then = history.at(image.time_s - delay_s());
    if (!q_then) return HoldReason::no_history;
    const double interval_s = std::max(0.0, image.time_s - last_image_s_);
    const auto update = jacobian_.update(*q_then, image.features, image.ends_px, interval_s);
    if (update != JacobianEstimator::Update::accepted) reason = HoldReason::outlier;
  }
  if (reason == HoldReason::none) last_image_s_ = image.time_s;
  return reason;
}

HoldReason UncalibratedEstimator::learn_from_probing(const ImageMeasurement& image, const JointHistory& history) {
  if (!motion_) motion_ = ProbingMotion(probing_, limits_, *history.newest());
  fit_.add(image.time_s, image.features, image.ends_px, history);
  if (probed_s_ < motion_->duration_s()) return HoldReason::none;
  const auto model = fit_.solve();
  if (!model) {
    probe_again();
    return HoldReason::not_learnt;
  }
  jacobian_.start(*model);
  learnt_delay_s_ = model->delay_s;
  learnt_ = true;
  return HoldReason::none;
}

void UncalibratedEstimator::probe_again() {
  fit_ = ProbingFit(scales_, known_delay_s_);
  motion_.reset();
  probed_s_ = 0;
}

std::optional<Eigen::Vector4d> UncalibratedEstimator::probing_velocity(double time_s) const {
  if (learnt_ || !motion_) return std::nullopt;
  return motion_->velocity(probed_s_ + time_s);
}

std::optional<Estimate> UncalibratedEstimator::at(double, const Eigen::Vector4d& q_joint) const {
  if (!learnt_) return std::nullopt;
  const FeatureState state = jacobian_.at(q_joint);
  Estimate now;
  now.q = q_joint;
  now.features = state.features;
  now.covariance = scales_.features.cwiseAbs2().asDiagonal();
  now.covariance *= jacobian_.variance_at(q_joint);
  now.jacobian = state.jacobian;
  now.ends_px = state.ends_px;
  now.ends_jacobian = state.ends_jacobian;
  return now;
}

}  // namespace lapservo::internal
