#include "lapservo/control/fused_estimator.h"

#include <utility>

namespace lapservo::internal {
namespace {

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

FusedEstimator::FusedEstimator(const ControllerConfig& config, FeatureModel model)
    : model_(std::move(model)), observer_(config.observer, config.scales) {}

HoldReason FusedEstimator::update(const ImageMeasurement& image, const JointHistory& history) {
  return reason_of(observer_.update(model_, history, image));
}

void FusedEstimator::set_model(const FeatureModel& model, bool anew) {
  model_ = model;
  if (anew) observer_.start_anew();
}

std::optional<Estimate> FusedEstimator::at(double time_s, const Eigen::Vector4d& q_joint) const {
  return observer_.estimate(model_, q_joint, time_s);
}

}  // namespace lapservo::internal
