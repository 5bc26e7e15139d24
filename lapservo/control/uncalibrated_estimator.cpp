#include "lapservo/control/uncalibrated_estimator.h"

#include <algorithm>

namespace lapservo::internal {
namespace {

bool contains(const ImageWindow& window, const Eigen::Vector4d& ends_px) {
  const Eigen::Array2d u(ends_px[0], ends_px[2]), v(ends_px[1], ends_px[3]);
  return u.minCoeff() >= window.u_min_px && u.maxCoeff() <= window.u_max_px && v.minCoeff() >= window.v_min_px &&
         v.maxCoeff() <= window.v_max_px;
}

}  // namespace

UncalibratedEstimator::UncalibratedEstimator(const ControllerConfig& config)
    : scales_(config.scales),
      limits_(config.limits),
      probing_(config.probing),
      known_delay_s_(config.observer.delay_s),
      jacobian_(config.jacobian, config.scales),
      fit_(config.scales, config.observer.delay_s),
      window_(config.window) {}

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
  if (!motion_) motion_ = ProbingMotion(probing_, limits_, *history.newest(), side_);
  if (window_ && !contains(*window_, image.ends_px)) turn_back();
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

// Nothing is known yet of what a joint does in the image but that it just left the window: back, and next time to the
// other side.
void UncalibratedEstimator::turn_back() {
  const double back_s = motion_->way_back_s(probed_s_);
  if (back_s == probed_s_) return;
  const auto joint = static_cast<Eigen::Index>(probed_s_ / probing_.joint_time_s);
  side_[joint] = -side_[joint];
  probed_s_ = back_s;
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
