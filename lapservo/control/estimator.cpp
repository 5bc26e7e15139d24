#include "lapservo/control/estimator.h"

#include <cmath>
#include <string>
#include <utility>

#include "lapservo/control/newton_inverse.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"

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

// Measured joints and late images fused by OffsetObserver.
class FusedEstimator : public Estimator {
 public:
  FusedEstimator(const ControllerConfig& config, FeatureModel model)
      : model_(std::move(model)),
        observer_(config.observer, config.scales),
        max_psi_offset_rad_(config.observer.max_offset[3]) {}

  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override {
    const auto measured = history.at(image.time_s - observer_.delay_s());
    if (image.q && measured && std::abs(wrap_pi((*image.q)[3] - (*measured)[3])) > max_psi_offset_rad_)
      return HoldReason::psi_contradicted;
    const HoldReason reason = reason_of(observer_.update(model_, history, image));
    return observer_.delay_is_contradicted() ? HoldReason::delay_not_found : reason;
  }
  std::optional<Estimate> at(double time_s, const Eigen::Vector4d& q_joint) const override {
    return observer_.estimate(model_, q_joint, time_s);
  }
  double delay_s() const override { return observer_.delay_s(); }
  void set_model(const FeatureModel& model) override {
    model_ = model;
    observer_.start_anew();
  }
  void interrupt() override { observer_.interrupt(); }
  void restart_tests() override { observer_.forget_contradiction(); }
  bool delay_is_known() const override { return observer_.delay_is_known(); }

 private:
  FeatureModel model_;
  OffsetObserver observer_;
  double max_psi_offset_rad_;
};

// As the paper has it: what the latest image shows is where the instrument is, and J is taken at the configuration that
// shows these features. The joints only start the search for it.
class LatestImageEstimator : public Estimator {
 public:
  LatestImageEstimator(const ControllerConfig& config, FeatureModel model)
      : model_(std::move(model)),
        scales_(config.scales),
        delay_s_(config.observer.delay_s.value_or(config.observer.initial_delay_s)) {}

  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override {
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
  std::optional<Estimate> at(double, const Eigen::Vector4d&) const override { return latest_; }
  double delay_s() const override { return delay_s_; }

 private:
  std::optional<Eigen::Vector4d> configuration_of(const ImageMeasurement& image, const JointHistory& history) const {
    std::optional<NewtonInverse> found;
    const auto try_from = [&](const std::optional<Eigen::Vector4d>& start) {
      if (start && (!found || !found->converged)) found = newton_inverse(model_, image.features, *start, scales_);
    };
    if (latest_) try_from(latest_->q);
    try_from(image.q);
    try_from(history.newest());
    return found ? std::optional(found->q) : std::nullopt;
  }

  FeatureModel model_;
  Scales scales_;
  double delay_s_;
  std::optional<Estimate> latest_;
};

}  // namespace

std::unique_ptr<Estimator> make_estimator(const ControllerConfig& config, const FeatureModel& model) {
  if (!model && config.mode != ControlMode::uncalibrated)
    throw InputError("controller", "mode", std::string(to_string(config.mode)), "a model (camera_from_rcm in the rig)");
  switch (config.mode) {
    case ControlMode::fused:
      return std::make_unique<FusedEstimator>(config, model);
    case ControlMode::paper:
      return std::make_unique<LatestImageEstimator>(config, model);
    case ControlMode::uncalibrated:
      return make_uncalibrated_estimator(config);
  }
  return nullptr;
}

}  // namespace lapservo::internal
