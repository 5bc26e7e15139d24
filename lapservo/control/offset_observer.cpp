#include "lapservo/control/offset_observer.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

constexpr double shortest_interval_s = 1e-3;
constexpr double longest_interval_s = 0.2;  // after a longer gap the gain grows through the covariance instead

/// Image noise that gives the steady-state gain 1 - exp(-bandwidth T) for a random walk of variance `walk` per image:
/// with k = P/(P + R) and P = walk / k before each update, R = walk (1 - k) / k^2.
Eigen::Vector4d noise_for_bandwidth(const Eigen::Vector4d& walk, double bandwidth_rad_s, double interval_s) {
  const double gain = -std::expm1(-bandwidth_rad_s * interval_s);
  return walk * ((1 - gain) / (gain * gain));
}

void follow(std::array<Backlash, 4>& backlashes, const Eigen::Vector4d& q_joint, const Eigen::Vector4d& widths) {
  for (int i = 0; i < 4; ++i) backlashes[static_cast<std::size_t>(i)].follow(q_joint[i], widths[i]);
}

Eigen::Vector4d instrument(const std::array<Backlash, 4>& backlashes, const Eigen::Vector4d& widths) {
  Eigen::Vector4d q;
  for (int i = 0; i < 4; ++i) q[i] = backlashes[static_cast<std::size_t>(i)].instrument(widths[i]);
  return q;
}

// The last seconds show whether the delay is still the one that all images gave.
DelayEstimatorConfig of_the_newest(DelayEstimatorConfig config) {
  constexpr double part = 0.15;
  config.forgetting_s *= part;
  return config;
}

/// How the measured joints changed before `time_s`, per second.
Eigen::Vector4d rate_before(const JointHistory& history, double time_s, const Eigen::Vector4d& q) {
  constexpr double span_s = 0.05;  // long enough for the measured joints' resolution
  const auto before = history.at(time_s - span_s);
  return before ? Eigen::Vector4d((q - *before) / span_s) : Eigen::Vector4d::Zero();
}

}  // namespace

OffsetObserver::OffsetObserver(const ObserverConfig& config, const Scales& scales, FeatureModel model)
    : model_(std::move(model)),
      config_(config),
      scales_(scales),
      delay_estimator_(config.delay_estimator),
      newest_delay_(of_the_newest(config.delay_estimator)),
      backlash_estimator_(config.backlash, scales),
      delay_s_(config.delay_s.value_or(config.initial_delay_s)) {}

Eigen::Vector4d OffsetObserver::walk_variance(double interval_s, const Eigen::Vector4d& moved) const {
  const double distance = moved.cwiseQuotient(scales_.joints).norm();
  return config_.offset_walk.cwiseAbs2() * interval_s +
         (config_.offset_per_motion * distance * scales_.joints).cwiseAbs2();
}

HoldReason OffsetObserver::update(const ImageMeasurement& image, const JointHistory& history) {
  const auto measured = history.at(image.time_s - delay_s_);
  if (image.q && measured && std::abs(wrap_pi((*image.q)[3] - (*measured)[3])) > config_.max_offset[3])
    return HoldReason::psi_contradicted;
  const HoldReason reason = use(image, history);
  return delay_is_contradicted() ? HoldReason::delay_not_found : reason;
}

HoldReason OffsetObserver::use(const ImageMeasurement& image, const JointHistory& history) {
  if (!image.features.allFinite() || !image.covariance.allFinite() || !image.ends_px.allFinite() ||
      !std::isfinite(image.time_s) || (image.q && !image.q->allFinite()))
    return HoldReason::non_finite;
  const auto q_then = history.at(image.time_s - delay_s_);
  if (!q_then) return HoldReason::no_history;
  follow_measured(history, image.time_s - delay_s_, *q_then);
  const Eigen::Vector4d q_driven_then = instrument(backlashes_then_, backlash_);
  if (!started_ || anew_) return start(q_driven_then, image);
  const auto state = model_(q_driven_then + offset_);
  if (!state) return start(q_driven_then, image);

  const Eigen::Vector4d residual = feature_error(image.features, state->features + feature_offset_);
  const Eigen::Matrix4d inverse = damped_inverse(state->jacobian, scales_).inverse;
  const Eigen::Vector4d innovation = inverse * residual;
  const double since_s = std::max(0.0, image.time_s - updated_s_);
  const double interval_s = std::clamp(since_s, shortest_interval_s, longest_interval_s);
  const Eigen::Matrix4d seen_noise = inverse * image.covariance * inverse.transpose();
  const Eigen::Matrix4d noise =
      seen_noise + Eigen::Matrix4d(noise_for_bandwidth(config_.offset_walk.cwiseAbs2() * interval_s,
                                                       config_.bandwidth_rad_s, interval_s)
                                       .asDiagonal());
  const Eigen::Matrix4d predicted =
      covariance_ + Eigen::Matrix4d(walk_variance(since_s, q_driven_then - q_driven_then_).asDiagonal());
  const Eigen::Matrix4d innovation_covariance = predicted + noise;
  const Eigen::LLT<Eigen::Matrix4d> factor(innovation_covariance);
  const double chi2 = innovation.dot(factor.solve(innovation));
  if (!std::isfinite(chi2)) return HoldReason::non_finite;
  if (chi2 > config_.gate_chi2) {
    if (!agrees_with_last_outlier(offset_ + innovation, innovation_covariance)) return HoldReason::outlier;
    return start(q_driven_then, image);
  }
  outliers_ = 0;
  const Eigen::Matrix4d gain = factor.solve(predicted).transpose();  // both symmetric
  offset_ += gain * innovation;
  covariance_ = predicted - gain * predicted;
  covariance_ = (0.5 * (covariance_ + covariance_.transpose())).eval();
  const Eigen::Vector4d within = within_limits(offset_);
  feature_offset_ += state->jacobian * (offset_ - within);
  offset_ = within;
  ends_offset_px_ +=
      -std::expm1(-config_.bandwidth_rad_s * interval_s) * (image.ends_px - state->ends_px - ends_offset_px_);
  const Eigen::Vector4d seen_offset = offset_ + innovation - gain * innovation;
  if (!config_.delay_s)
    for (DelayEstimator* estimator : {&delay_estimator_, &newest_delay_})
      estimator->add(image.time_s, *q_then + seen_offset, seen_noise, history);
  if (delay_is_right()) {
    backlash_estimator_.add(image.time_s, rate_before(history, image.time_s - delay_s_, *q_then),
                            q_driven_then + seen_offset, seen_noise);
  }
  updated_s_ = image.time_s;
  q_driven_then_ = q_driven_then;
  follow_delay(interval_s);
  follow_backlash(interval_s);
  return HoldReason::none;
}

void OffsetObserver::follow_measured(const JointHistory& history, double time_s, const Eigen::Vector4d& q_then) {
  if (!started_)
    for (int i = 0; i < 4; ++i) backlashes_then_[static_cast<std::size_t>(i)] = Backlash(q_then[i]);
  const auto follow_all = [this](const Eigen::Vector4d& q) {
    follow(backlashes_then_, q, backlash_);
    backlash_estimator_.follow(q);
  };
  if (started_) history.visit(followed_s_, time_s, follow_all);
  follow_all(q_then);
  followed_s_ = std::max(followed_s_, time_s);
  backlashes_ = backlashes_then_;
  history.visit(time_s, history.newest_s(), [this](const Eigen::Vector4d& q) { follow(backlashes_, q, backlash_); });
}

HoldReason OffsetObserver::start(const Eigen::Vector4d& q_driven_then, const ImageMeasurement& image) {
  // From where the image says, then from where the measured joints say.
  std::optional<NewtonInverse> found;
  if (image.q) found = newton_inverse(model_, image.features, *image.q, scales_);
  if (!found || !found->converged) {
    const auto other = newton_inverse(model_, image.features, q_driven_then + offset_, scales_);
    if (!found || (other && other->converged)) found = other;
  }
  if (!found) return HoldReason::not_modelled;
  Eigen::Vector4d offset = found->q - q_driven_then;
  for (const Eigen::Index k : {0, 3}) offset[k] = wrap_pi(offset[k]);  // the image knows no turns of theta and psi
  offset = within_limits(offset);
  const auto limited = model_(q_driven_then + offset);
  if (!limited) return HoldReason::not_modelled;
  offset_ = offset;
  feature_offset_ = feature_error(image.features, limited->features);
  ends_offset_px_ = image.ends_px - limited->ends_px;
  const Eigen::Matrix4d inverse = damped_inverse(limited->jacobian, scales_).inverse;
  covariance_ =
      inverse * image.covariance * inverse.transpose() +
      Eigen::Matrix4d(
          noise_for_bandwidth(config_.offset_walk.cwiseAbs2() / 60, config_.bandwidth_rad_s, 1.0 / 60).asDiagonal());
  updated_s_ = image.time_s;
  q_driven_then_ = q_driven_then;
  outliers_ = 0;
  started_ = true;
  anew_ = false;
  interrupt();
  return HoldReason::none;
}

void OffsetObserver::interrupt() {
  backlash_estimator_.interrupt();
  delay_estimator_.interrupt();
  newest_delay_.interrupt();
}

bool OffsetObserver::agrees_with_last_outlier(const Eigen::Vector4d& seen_offset,
                                              const Eigen::Matrix4d& innovation_covariance) {
  const Eigen::Vector4d apart = seen_offset - last_outlier_;
  const bool agrees = outliers_ > 0 && apart.dot(innovation_covariance.ldlt().solve(apart)) < config_.gate_chi2;
  outliers_ = agrees ? outliers_ + 1 : 1;
  last_outlier_ = seen_offset;
  return outliers_ >= config_.reacquire_after;
}

Eigen::Vector4d OffsetObserver::within_limits(const Eigen::Vector4d& offset) const {
  return offset.cwiseMax(-config_.max_offset).cwiseMin(config_.max_offset);
}

void OffsetObserver::follow_delay(double interval_s) {
  if (config_.delay_s) return;
  if (delay_seen_ && newest_delay_.contradicts(delay_s_)) forget_delay();
  const auto seen = delay_estimator_.estimate();
  if (!seen) return;
  constexpr double fastest = 0.1;  // seconds of delay per second, so that the prediction does not jump
  delay_s_ += std::clamp(seen->delay_s - delay_s_, -fastest * interval_s, fastest * interval_s);
  delay_seen_ = delay_seen_ || delay_is_right();
}

// It is a guess until it is found anew.
void OffsetObserver::forget_delay() {
  delay_estimator_ = DelayEstimator(config_.delay_estimator);
  newest_delay_ = DelayEstimator(of_the_newest(config_.delay_estimator));
  delay_seen_ = false;
}

bool OffsetObserver::delay_is_right() const {
  if (config_.delay_s) return true;
  constexpr double near_s = 0.004;
  const auto seen = delay_estimator_.estimate();
  return seen && std::abs(seen->delay_s - delay_s_) < near_s;
}

void OffsetObserver::follow_backlash(double interval_s) {
  constexpr double time_constant_s = 1, sure = 3;
  const Eigen::Vector4d before = instrument(backlashes_, backlash_);
  for (int i = 0; i < 4; ++i) {
    const auto seen = backlash_estimator_.estimate(i);
    if (!seen || seen->sigma > config_.backlash.max_sigma * config_.backlash.largest[i]) continue;
    const double width = seen->width > sure * seen->sigma ? seen->width : 0;
    backlash_[i] += -std::expm1(-interval_s / time_constant_s) * (width - backlash_[i]);
  }
  offset_ -= instrument(backlashes_, backlash_) - before;
}

std::optional<Estimate> OffsetObserver::at(double time_s, const Eigen::Vector4d& q_joint) const {
  if (!started_ || anew_) return std::nullopt;
  Backlashes backlashes = backlashes_;
  follow(backlashes, q_joint, backlash_);
  const GapState gap{backlash_, instrument(backlashes, backlash_) - q_joint};
  const Eigen::Vector4d q = q_joint + gap.shift + offset_;
  const auto state = model_(q);
  if (!state) return std::nullopt;
  Estimate now{*state, q, gap};
  const double age_s = std::max(0.0, time_s - updated_s_) + delay_s_;
  now.q_covariance =
      covariance_ + Eigen::Matrix4d(walk_variance(age_s, q_joint + now.gap.shift - q_driven_then_).asDiagonal());
  now.features += feature_offset_;
  now.covariance = feature_covariance(*state, now.q_covariance);
  now.ends_px += ends_offset_px_;
  return now;
}

}  // namespace lapservo::internal
