#pragma once

#include <bitset>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <span>

#include <Eigen/Core>

#include "lapservo/control/arm_response.h"
#include "lapservo/control/control_step.h"
#include "lapservo/control/controller_config.h"
#include "lapservo/control/estimator.h"
#include "lapservo/control/feature_model.h"
#include "lapservo/control/following_error_limit.h"
#include "lapservo/control/frozen_image.h"
#include "lapservo/control/hold_reason.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/image_response.h"
#include "lapservo/control/joint_history.h"
#include "lapservo/control/motion_limits.h"
#include "lapservo/control/standing_goal.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/control/wild_joints.h"
#include "lapservo/robot/joint_path.h"
#include "lapservo/robot/robot.h"

namespace lapservo::internal {

/// Whether images usually come too seldom: more than half of the latest ones came after the loop had held for the age
/// of the one before. Pauses between images that are often enough are not that.
class SlowImages {
 public:
  /// A usable image; `late`: the one before was too old already.
  void add(bool late) {
    latest_ = latest_ << 1;
    latest_[0] = late;
    slow_ = latest_.count() >= (slow_ ? few_ : many_);
  }
  bool are_slow() const { return slow_; }

 private:
  static constexpr std::size_t many_ = 6, few_ = 3;  // of the latest; slow until fewer than these
  std::bitset<8> latest_;
  bool slow_ = false;
};

/// The visual servo controller: measured joints, images and desired features in, joint velocities and setpoints out.
/// One call a period; no allocation in it; every number that leaves is finite; setpoints never leave the joint limits
/// and never change faster than rate and acceleration limits allow, whatever comes in (limit_velocity has the proof).
class VisualController {
 public:
  /// Throws InputError for a configuration that can't work. `model` maps q to features; the uncalibrated mode does
  /// not use it and takes an empty one.
  VisualController(const ControllerConfig& config, FeatureModel model);

  /// Starts the setpoints anew at rest at the arm's measured joints; what was learnt from images is kept. Called by the
  /// first step() too.
  void reset(double time_s, const Eigen::Vector4d& q_joint);

  /// The same after a hold, of an arm that was enabled all the while: under its load it keeps the place that it has.
  void start_over(double time_s, const Eigen::Vector4d& q_joint);

  /// Images of before that time move nothing: the arm may be elsewhere since.
  void need_image_since(double time_s) { needed_since_s_ = time_s; }

  /// The operator says start: what held until then counts no more, and the image has to show each joint's motion anew.
  void restart_tests();

  /// From the next step on the model does not count: nothing is estimated, and the arm holds for that reason.
  void suspend(HoldReason reason) { suspended_ = reason; }
  /// And on again with the model that was there.
  void resume() { suspended_ = HoldReason::none; }
  /// Or with another one, as soon as an image shows where the instrument is.
  void resume(const FeatureModel& model);
  /// Where the joints were measured when that image was exposed; nullopt when not known.
  std::optional<Eigen::Vector4d> measured_at(const ImageMeasurement& image) const {
    const double time_s = image.time_s - delay_s();
    return history_.pauses(time_s, time_s) ? std::nullopt : history_.at(time_s);
  }

  /// `image` is given once, in the first step after it arrived; `desired` is for the time `time_s`; `readings`: see
  /// Robot::readings().
  ControlStep step(double time_s, const Eigen::Vector4d& q_joint, const std::optional<ImageMeasurement>& image,
                   const DesiredFeatures& desired, std::span<const JointReading> readings = {});

  /// Whether the arm goes where it is sent, from the next step on: JointState::follows.
  void expect_following(bool follows) { follows_ = follows; }

  /// The setpoints from the latest step on.
  const JointPath& path() const { return path_; }
  /// Whether the last step's joints were where joints can be.
  bool has_measured() const { return measured_; }
  const ControllerConfig& config() const { return config_; }
  /// The delay, known or estimated.
  double delay_s() const { return estimator_->delay_s(); }
  /// Whether it is more than a guess.
  bool delay_is_known() const { return estimator_->delay_is_known(); }

 private:
  struct Law {
    HoldReason reason = HoldReason::none;
    ControlAction action = ControlAction::track;
    Eigen::Vector4d velocity = Eigen::Vector4d::Zero();
    Eigen::Vector4d rate = Eigen::Vector4d::Ones();          ///< no joint is faster
    Eigen::Vector4d feed_forward = Eigen::Vector4d::Zero();  ///< the part of it that the desired motion alone requires
    Eigen::Matrix4d weight = Eigen::Matrix4d::Identity();    ///< of deviations from it
    std::optional<EndPoints> ends{};                         ///< at the setpoint
    Stop stop{};                                             ///< what limits of position leave of it
    bool is_slowed = false;                                  ///< for the rate
  };

  HoldReason read(double time_s, const Eigen::Vector4d& q_joint, const DesiredFeatures& desired,
                  std::span<const JointReading> readings);
  void remember(double time_s, const Eigen::Vector4d& q_joint, std::span<const JointReading> readings);
  HoldReason update(const ImageMeasurement& image);
  HoldReason by_their_rate(HoldReason reason) const;
  Law decide(HoldReason reason, const Eigen::Vector4d& q_joint, const std::optional<Estimate>& estimate,
             const DesiredFeatures& desired) const;
  Law tracking_law(const std::optional<Estimate>& estimate, const DesiredFeatures& desired) const;
  void slow(Law& law, const Eigen::Vector4d& q_joint, const std::optional<Estimate>& estimate) const;
  void limit(const Law& law, const Eigen::Vector4d& q_joint, ControlStep& step) const;
  Eigen::Vector4d limited_hold(const Eigen::Vector4d& braking) const;

  ControllerConfig config_;
  TrackingGains exact_gains_;
  Eigen::Matrix4d joint_weight_;  ///< of deviations, in joint scales
  std::unique_ptr<Estimator> estimator_;
  JointHistory history_;
  ArmResponse arm_response_;
  FollowingErrorLimit following_error_limit_;
  FrozenImage frozen_image_;
  ImageResponse image_response_;
  ErrorGrowth error_growth_;
  LimitedGoal limited_goal_;
  HoldReason until_start_ = HoldReason::none;  ///< a reason that only an operator ends
  std::optional<PositionLimit> stops_at_;      ///< the last limit that took part of the motion
  std::optional<PositionLimit> grows_at_;      ///< with error_grows, where it is one
  WildJoints wild_joints_;
  JointPath path_;
  HoldReason suspended_ = HoldReason::none;
  bool started_ = false;
  bool follows_ = true;
  Eigen::Vector4d q_read_ = Eigen::Vector4d::Zero();  ///< of the latest tick
  bool joints_are_wild_ = false;
  bool measured_ = false;      ///< the joints of this tick are plausible
  bool has_readings_ = false;  ///< between ticks
  double now_s_ = 0;
  HoldReason image_reason_ = HoldReason::no_image_yet;  ///< of the latest image
  std::optional<double> image_s_;                       ///< stamp of the latest image
  std::optional<double> images_from_s_;                 ///< of the first one after a pause
  double usable_s_ = 0;                                 ///< when the last usable one arrived
  bool stale_ = false;                                  ///< it is too old
  SlowImages slow_images_;
  double needed_since_s_ = -std::numeric_limits<double>::infinity();
};

}  // namespace lapservo::internal
