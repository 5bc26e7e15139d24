#pragma once

#include <optional>
#include <variant>

#include "lapservo/control/estimator.h"
#include "lapservo/control/jacobian_estimator.h"
#include "lapservo/control/probing.h"

namespace lapservo::internal {

/// Without a model: a small probing motion gives the Jacobian and the delay, and JacobianEstimator keeps learning.
class UncalibratedEstimator : public Estimator {
 public:
  explicit UncalibratedEstimator(const ControllerConfig& config) : config_(config) {}
  HoldReason update(const ImageMeasurement& image, const JointHistory& history) override;
  std::optional<Estimate> at(double time_s, const Eigen::Vector4d& q_joint) const override;
  double delay_s() const override;
  std::optional<Eigen::Vector4d> probing_velocity(double time_s) const override;
  void advance_probing(double time_s) override;
  std::optional<Unanswered> unanswered() const override { return unanswered_; }
  void interrupt() override { restart_probing(); }
  void restart_probing() override {
    if (std::holds_alternative<Probing>(state_)) state_ = Waiting{};
  }

 private:
  /// For an image, by which the probing motion begins.
  struct Waiting {};
  struct Probing {
    ProbingMotion motion;
    ProbingFit fit;
    ProbingResponse response;
    double probed_s = 0;
    double pace = 0;                ///< of the motion: slower until an image shows the joint's
    Eigen::Index joint = -1;        ///< that is probed
    double beyond_at_first_px = 0;  ///< of the window, in the first image of that joint's motion
  };
  struct Learnt {
    JacobianEstimator jacobian;
    double delay_s;
    double last_image_s;  ///< stamp of the last one used
  };

  HoldReason learn(Probing& probing, const ImageMeasurement& image, const JointHistory& history);
  void stay_inside(Probing& probing, const ImageWindow& window, const Eigen::Vector4d& ends_px);
  bool is_answered(Probing& probing, const ImageMeasurement& image, const JointHistory& history);
  double pace_of(const Probing& probing) const;
  HoldReason follow(Learnt& learnt, const ImageMeasurement& image, const JointHistory& history) const;

  ControllerConfig config_;
  Eigen::Vector4d side_ = Eigen::Vector4d::Ones();  ///< to which the joints are probed
  std::variant<Waiting, Probing, Learnt> state_;
  std::optional<Unanswered> unanswered_;
};

}  // namespace lapservo::internal
