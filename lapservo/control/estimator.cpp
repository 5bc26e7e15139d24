#include "lapservo/control/estimator.h"

#include <string>

#include "lapservo/control/fused_estimator.h"
#include "lapservo/control/latest_image_estimator.h"
#include "lapservo/control/uncalibrated_estimator.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {

void Estimator::set_model(const FeatureModel&) {}

std::optional<Eigen::Vector4d> Estimator::probing_velocity(double) const {
  return std::nullopt;
}

void Estimator::advance_probing(double) {}

std::unique_ptr<Estimator> make_estimator(const ControllerConfig& config, const FeatureModel& model) {
  if (!model && config.mode != ControlMode::uncalibrated)
    throw InputError("controller", "mode", std::string(to_string(config.mode)), "a model (camera_from_rcm in the rig)");
  switch (config.mode) {
    case ControlMode::fused:
      return std::make_unique<FusedEstimator>(config, model);
    case ControlMode::paper:
      return std::make_unique<LatestImageEstimator>(config, model);
    case ControlMode::uncalibrated:
      return std::make_unique<UncalibratedEstimator>(config);
  }
  return nullptr;
}

}  // namespace lapservo::internal
