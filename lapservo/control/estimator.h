#pragma once

#include <memory>
#include <optional>

#include <Eigen/Core>

#include "lapservo/control/control_step.h"
#include "lapservo/control/controller_config.h"
#include "lapservo/control/feature_model.h"
#include "lapservo/control/hold_reason.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/joint_history.h"

namespace lapservo::internal {

/// Where the instrument is now and what the image's features do when its joints move, made of the measured joints and
/// the images so far. One implementation a ControlMode.
class Estimator {
 public:
  virtual ~Estimator() = default;

  /// A frame that shows the marker; its numbers are finite. `history` reaches to now. HoldReason::none when it was
  /// used.
  virtual HoldReason update(const ImageMeasurement& image, const JointHistory& history) = 0;

  /// The instrument at `time_s`, the joints being measured there at `q_joint`; nullopt while nothing is known.
  virtual std::optional<Estimate> at(double time_s, const Eigen::Vector4d& q_joint) const = 0;

  /// The images' delay, known or estimated.
  virtual double delay_s() const = 0;
  /// False while it is a first guess: until motion shows it; ControlMode::paper never learns one.
  virtual bool delay_is_known() const { return true; }

  /// The joint that a probing motion moved and no image showed, with HoldReason::image_not_following.
  virtual std::optional<Unanswered> unanswered() const { return std::nullopt; }

  /// Another camera_from_rcm: the estimates of delay and backlash stay, the next image gives the instrument's place.
  virtual void set_model(const FeatureModel& /*model*/) {}

  /// The measured joints jumped: nothing is to be learnt across.
  virtual void interrupt() {}

  /// The arm is moved by somebody else, or was: a probing motion begins anew.
  virtual void restart_probing() {}
  /// A person said start: what contradicted itself is looked at anew.
  virtual void restart_tests() {}

  /// The motion of the joints, `time_s` after the last advance_probing(), that it needs to see before it can estimate
  /// anything; nullopt when it needs none.
  virtual std::optional<Eigen::Vector4d> probing_velocity(double /*time_s*/) const { return std::nullopt; }
  /// So much of that motion has been commanded.
  virtual void advance_probing(double /*time_s*/) {}
};

/// `model` maps q to features; ControlMode::uncalibrated does without, the others throw InputError when it is empty.
std::unique_ptr<Estimator> make_estimator(const ControllerConfig& config, const FeatureModel& model);
/// That of ControlMode::uncalibrated.
std::unique_ptr<Estimator> make_uncalibrated_estimator(const ControllerConfig& config);

}  // namespace lapservo::internal
