#pragma once

#include <array>
#include <optional>
#include <utility>

#include <Eigen/Core>

#include "lapservo/control/backlash_estimator.h"
#include "lapservo/control/controller_config.h"
#include "lapservo/control/delay_estimator.h"
#include "lapservo/control/estimator.h"
#include "lapservo/robot/backlash.h"

namespace lapservo::internal {

/// Fuses measured joints, which are fast and smooth but off (kinematic offsets, backlash), with the image, which is
/// right but late. The state is the offset b such that the model at p(t - delay) + b shows the features seen at t: a
/// slowly varying random walk, estimated by a Kalman filter with full covariance. Then the features now are those of
/// the model at p(now) + b, so the delay does not enter the loop except through changes of b. Here p are the measured
/// joints through a backlash as wide as BacklashEstimator has found it: nothing at first. When the width changes b
/// changes against it, so that the estimate does not jump.
///
/// The innovation is the difference in *features*, carried to q by the damped inverse of the model's Jacobian. The
/// filter rests only where that difference is zero on average, so in steady state the features are unbiased whatever is
/// wrong with the model: a wrong model only changes how fast b follows. With M = J_true J_model^-1 the loop is stable
/// for every delay and bandwidth when all eigenvalues of M lie within 1 of 1 (small gain), and for bandwidths well
/// below 1 / delay when they have positive real parts.
class OffsetObserver : public Estimator {
 public:
  OffsetObserver(const ObserverConfig& config, const Scales& scales, FeatureModel model);

  /// The first image, and the last of several outliers that agree, start the offset anew. Others are ignored: outlier,
  /// no_history, not_modelled, non_finite, psi_contradicted. delay_not_found: ample motion did not give the delay.
  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override;
  /// nullopt before the first image and where the model sees nothing.
  std::optional<Estimate> at(double time_s, const Eigen::Vector4d& q_joint) const override;
  void set_model(const FeatureModel& model) override {
    model_ = model;
    anew_ = true;
  }
  void interrupt() override;
  /// Looks for the delay anew where images and joints agreed at none.
  void restart_tests() override {
    if (delay_is_contradicted()) forget_delay();
  }
  double delay_s() const override { return delay_s_; }
  /// Given, or estimated, and the newest images agree with it.
  bool delay_is_known() const override { return config_.delay_s || delay_seen_; }
  const Eigen::Vector4d& offset() const { return offset_; }
  /// Full backlash between measured joints and instrument, joint by joint, as far as it has been learnt.
  const Eigen::Vector4d& backlash() const { return backlash_; }

 private:
  using Backlashes = std::array<Backlash, 4>;

  HoldReason use(const ImageMeasurement& image, const JointHistory& history);
  HoldReason start(const Eigen::Vector4d& q_driven_then, const ImageMeasurement& image);
  bool agrees_with_last_outlier(const Eigen::Vector4d& seen_offset, const Eigen::Matrix4d& innovation_covariance);
  Eigen::Vector4d within_limits(const Eigen::Vector4d& offset) const;
  void follow_delay(double interval_s);
  void forget_delay();
  void follow_measured(const JointHistory& history, double time_s, const Eigen::Vector4d& q_then);
  void follow_backlash(double interval_s);
  bool delay_is_right() const;
  bool delay_is_contradicted() const { return !delay_is_known() && delay_estimator_.is_contradicted(); }
  Eigen::Vector4d walk_variance(double interval_s, const Eigen::Vector4d& moved) const;

  FeatureModel model_;
  ObserverConfig config_;
  Scales scales_;
  DelayEstimator delay_estimator_, newest_delay_;
  BacklashEstimator backlash_estimator_;
  Eigen::Vector4d backlash_ = Eigen::Vector4d::Zero();
  Backlashes backlashes_then_, backlashes_;  ///< at the last image, at the last reading before it came
  double followed_s_ = 0;                    ///< the time of backlashes_then_
  double delay_s_;
  bool delay_seen_ = false;
  bool started_ = false;
  bool anew_ = false;                                         ///< the offset belongs to another model
  double updated_s_ = 0;                                      ///< stamp of the last accepted image
  Eigen::Vector4d q_driven_then_ = Eigen::Vector4d::Zero();   ///< measured joints through their backlash at that image
  Eigen::Vector4d offset_ = Eigen::Vector4d::Zero();          ///< b
  Eigen::Matrix4d covariance_ = Eigen::Matrix4d::Zero();      ///< of b
  Eigen::Vector4d feature_offset_ = Eigen::Vector4d::Zero();  ///< what b can't explain
  Eigen::Vector4d ends_offset_px_ = Eigen::Vector4d::Zero();
  int outliers_ = 0;
  Eigen::Vector4d last_outlier_ = Eigen::Vector4d::Zero();  ///< the offset it would have meant
};

}  // namespace lapservo::internal
