#pragma once

#include <optional>

#include "lapservo/control/estimator.h"
#include "lapservo/control/jacobian_estimator.h"
#include "lapservo/control/probing.h"

namespace lapservo::internal {

/// Without any model: a small probing motion tells the Jacobian and the delay, and JacobianEstimator keeps learning.
class UncalibratedEstimator : public Estimator {
 public:
  explicit UncalibratedEstimator(const ControllerConfig& config);
  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override;
  std::optional<Estimate> at(double time_s, const Eigen::Vector4d& q_joint) const override;
  double delay_s() const override { return known_delay_s_.value_or(learnt_delay_s_); }
  std::optional<Eigen::Vector4d> probing_velocity(double time_s) const override;
  void advance_probing(double time_s) override { probed_s_ += time_s; }

 private:
  HoldReason learn_from_probing(const ImageMeasurement& image, const JointHistory& history);
  void probe_again();
  void turn_back();

  Scales scales_;
  JointLimits limits_;
  ProbingConfig probing_;
  std::optional<double> known_delay_s_;
  JacobianEstimator jacobian_;
  std::optional<ProbingMotion> motion_;
  Eigen::Vector4d side_ = Eigen::Vector4d::Ones();  ///< to which the joints are probed
  ProbingFit fit_;
  std::optional<ImageWindow> window_;
  double probed_s_ = 0;
  bool learnt_ = false;
  double learnt_delay_s_ = 0;
  double last_image_s_ = 0;  ///< stamp of the last one used
};

}  // namespace lapservo::internal
