#include "lapservo/control/latest_image_estimator.h"

#include <utility>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/tracking_law.h"

namespace lapservo::internal {

LatestImageEstimator::LatestImageEstimator(const ControllerConfig& config, FeatureModel model)
    : model_(std::move(model)),
      scales_(config.scales),
      delay_s_(config.observer.delay_s.value_or(config.observer.initial_delay_s)) {}

std::optional<Eigen::Vector4d> LatestImageEstimator::configuration_of(const ImageMeasurement& image,
                                                                      const JointHistory& history) const {
  std::optional<NewtonInverse> found;
  const auto try_from = [&](const std::optional<Eigen::Vector4d>& start) {
    if (start && (!found || !found->converged)) found = newton_inverse(model_, image.features, *start, scales_);
  };
  if (latest_) try_from(latest_->q);
  try_from(image.q);
  try_from(history.newest());
  return found ? std::optional(found->q) : std::nullopt;
}

HoldReason LatestImageEstimator::update(const ImageMeasurement& image, const JointHistory& history) {
  const auto q = configuration_of(image, history);
  const auto state = q ? model_(*q) : std::nullopt;
  if (!state) return HoldReason::not_modelled;
  Estimate seen;
  seen.q = *q;
  seen.features = image.features;
  seen.covariance = image.covariance;
  const Eigen::Matrix4d inverse = damped_inverse(state->jacobian, scales_).inverse;
  seen.q_covariance = inverse * image.covariance * inverse.transpose();
  seen.jacobian = state->jacobian;
  seen.ends_px = image.ends_px;
  seen.ends_jacobian = state->ends_jacobian;
  latest_ = seen;
  return HoldReason::none;
}

}  // namespace lapservo::internal
