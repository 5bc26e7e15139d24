#pragma once

#include "lapservo/control/estimator.h"

namespace lapservo::internal {

/// Measured joints and late images fused by OffsetObserver.
class FusedEstimator : public Estimator {
 public:
  FusedEstimator(const ControllerConfig& config, FeatureModel model);
  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override;
  std::optional<Estimate> at(double time_s, const Eigen::Vector4d& q_joint) const override;
  double delay_s() const override { return observer_.delay_s(); }
  void set_model(const FeatureModel& model) override;
  void interrupt() override { observer_.interrupt(); }
  bool delay_is_known() const override { return observer_.delay_is_known(); }

 private:
  FeatureModel model_;
  OffsetObserver observer_;
  double max_psi_offset_rad_;
};

}  // namespace lapservo::internal
