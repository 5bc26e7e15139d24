#include "lapservo/control/estimator.h"

#include <string>
#include <utility>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/offset_observer.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

// As the paper has it: what the latest image shows is where the instrument is, and J is taken at the configuration that
// shows these features. The joints only start the search for it.
class LatestImageEstimator : public Estimator {
 public:
  LatestImageEstimator(const ControllerConfig& config, FeatureModel model)
      : model_(std::move(model)),
        scales_(config.scales),
        delay_s_(config.observer.delay_s.value_or(config.observer.initial_delay_s)),
        delay_is_given_(config.observer.delay_s.has_value()) {}

  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override {
    const auto q = configuration_of(image, history);
    const auto state = q ? model_(*q) : std::nullopt;
    if (!state) return HoldReason::not_modelled;
    Estimate seen{*state};
    seen.q = *q;
    seen.features = image.features;
    seen.covariance = image.covariance;
    const Eigen::Matrix4d inverse = damped_inverse(state->jacobian, scales_).inverse;
    seen.q_covariance = inverse * image.covariance * inverse.transpose();
    seen.ends_px = image.ends_px;
    latest_ = seen;
    return HoldReason::none;
  }
  std::optional<Estimate> at(double, const Eigen::Vector4d&) const override { return latest_; }
  double delay_s() const override { return delay_s_; }
  bool delay_is_known() const override { return delay_is_given_; }

 private:
  std::optional<Eigen::Vector4d> configuration_of(const ImageMeasurement& image, const JointHistory& history) const {
    std::optional<NewtonInverse> found;
    for (const auto& start : {latest_ ? std::optional(latest_->q) : std::nullopt, image.q, history.newest()})
      if (start && (!found || !found->converged)) found = newton_inverse(model_, image.features, *start, scales_);
    return found ? std::optional(found->q) : std::nullopt;
  }

  FeatureModel model_;
  Scales scales_;
  double delay_s_;
  bool delay_is_given_;
  std::optional<Estimate> latest_;
};

}  // namespace

std::unique_ptr<Estimator> make_estimator(const ControllerConfig& config, const FeatureModel& model) {
  if (config.mode == ControlMode::uncalibrated) return make_uncalibrated_estimator(config);
  if (!model)
    throw InputError("controller", "mode", std::string(to_string(config.mode)), "a model (camera_from_rcm in the rig)");
  if (config.mode == ControlMode::paper) return std::make_unique<LatestImageEstimator>(config, model);
  return std::make_unique<OffsetObserver>(config.observer, config.scales, model);
}

}  // namespace lapservo::internal
