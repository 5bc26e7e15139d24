#pragma once

#include "lapservo/control/estimator.h"

namespace lapservo::internal {

/// As the paper has it: what the latest image shows is where the instrument is, and J is taken at the configuration
/// that shows these features. The joints only start the search for it.
class LatestImageEstimator : public Estimator {
 public:
  LatestImageEstimator(const ControllerConfig& config, FeatureModel model);
  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override;
  std::optional<Estimate> at(double, const Eigen::Vector4d&) const override { return latest_; }
  double delay_s() const override { return delay_s_; }

 private:
  std::optional<Eigen::Vector4d> configuration_of(const ImageMeasurement& image, const JointHistory& history) const;

  FeatureModel model_;
  Scales scales_;
  double delay_s_;
  std::optional<Estimate> latest_;
};

}  // namespace lapservo::internal
