#include "lapservo/control/fused_estimator.h"

#include <cmath>
#include <utility>

#include "lapservo/core/angles.h"

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
    : model_(std::move(model)),
      observer_(config.observer, config.scales),
      max_psi_offset_rad_(config.observer.max_offset[3]) {}

HoldReason FusedEstimator::update(const ImageMeasurement& image, const JointHistory& history) {
  const auto measured = history.at(image.time_s - observer_.delay_s());
  if (image.q && measured && std::abs(wrap_pi((*image.q)[3] - (*measured)[3])) > max_psi_offset_rad_)
    return HoldReason::psi_contradicted;
  return reason_of(observer_.update(model_, history, image));
}

void FusedEstimator::set_model(const FeatureModel& model) {
  model_ = model;
  observer_.start_anew();
}

std::optional<Estimate> FusedEstimator::at(double time_s, const Eigen::Vector4d& q_joint) const {
  return observer_.estimate(model_, q_joint, time_s);
}

}  // namespace lapservo::internal
