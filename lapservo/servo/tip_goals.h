#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/control/joint_history.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/control/wild_readings.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/robot.h"

namespace lapservo::internal {

/// Turns goals of the tip into the features of the configuration that holds the tip there, by camera_from_rcm and by
/// the tool as its wrist is and moves now. The image removes errors of the registration: the tip by the seen marker
/// lies beside the tip by the measured features and the registration, and the goal is moved by that the other way, at
/// its depth. The law brings the features to the desired ones; then the tip's image lies on that of the goal, whatever
/// the registration. The depth along the line of sight stays as the registration has it.
class TipGoals {
 public:
  /// Goals of the tip need the first instrument's camera_from_rcm and its tool with a place; others pass unchanged.
  TipGoals(const Rig& rig, const Scales& scales);

  /// Throws InputError, naming `source`, where the rig, or the arm's measured joints, lack what a goal of the tip
  /// needs, and where the tool leaves the tip open by more than 3 mm (one sigma) with its wrist as it is.
  void refuse_incomplete(const std::string& source, bool has_joints) const;

  /// The same trajectory in features, by all that is known at each call; refers to this. Where no configuration
  /// holds the tip at the goal, or the wrist has bent until its tip is left open by more than 3 mm, the features rest
  /// where they were, are NaN before the first, and have the reason for which the loop holds; while the registration is
  /// measured anew the loop holds for that. They are NaN, for which the loop holds, where the wrist is not known.
  Trajectory features_of(const Trajectory& goal);

  /// A state of the joints: where the wrist is, how it moves; the psi of a roll that is free until an image has it,
  /// anew from every start on. The wrist is not known by readings that are missing or not finite, nor by those that no
  /// wrist can have come to since the last ones, until three of them agree.
  void follow(const JointState& joints);
  /// The registration from now on; nullopt while it is measured anew.
  void use(const std::optional<Rigid3>& camera_from_rcm);
  /// An image that the loop has used, taken with that registration.
  void see(const ImageMeasurement& image, const Rigid3& camera_from_rcm);

  /// Readings of the wrist's joints, in the tool's order, moved on by `ahead_s` as they move [rad]; none for a straight
  /// tool. Nullopt without a tool and where the wrist is not known.
  std::optional<std::vector<double>> wrist_rad(double ahead_s) const;
  /// The same as it was `ago_s` before, by the last 1024 readings: between two of them, or the nearest one.
  std::optional<std::vector<double>> past_wrist_rad(double ago_s) const;
  /// The configuration for a goal, corrected by the images, with the wrist as it is after `ahead_s`.
  std::optional<JointVector> configuration(const TipGoal& goal, double ahead_s = 0) const;
  /// Where the registration has the tip.
  std::optional<Eigen::Vector3d> tip_at(const JointVector& q) const;
  /// The seen tip beside a goal, in ideal pixels, by an image that was exposed `ago_s` before.
  std::optional<Eigen::Vector2d> error_px(const ImageMeasurement& image, const TipGoal& goal, double ago_s) const;

 private:
  std::optional<DesiredFeatures> desired(const Trajectory& goal, double time_s) const;
  std::optional<Rigid3> marker_from_tip(const std::optional<std::vector<double>>& wrist_rad) const;
  /// In the direction in which the tool leaves it open most.
  double tip_sigma_m(double ahead_s) const;
  void follow_wrist(const std::vector<double>& now_rad, double time_s);

  Rig rig_;
  Scales scales_;
  std::optional<Rigid3> camera_from_rcm_;
  FeatureModel model_;
  Eigen::Vector4d q_ = Eigen::Vector4d::Zero();  ///< measured
  struct WristMotion {
    double rad = 0;  ///< as it was read last
    double smooth_rad = 0, rad_s = 0, rad_s2 = 0;
  };
  std::vector<WristMotion> wrist_;  ///< empty where it is not known
  JointHistory past_wrist_;         ///< since when it is known; 0 behind its joints
  WildReadings<4> wild_wrist_;
  double wrist_s_ = -std::numeric_limits<double>::infinity();  ///< of the last readings
  bool tip_wanted_ = false;                                    ///< by the goal of the last call
  bool roll_wanted_ = false;
  double psi_rad_ = 0;  ///< of a roll that is free
  enum class PsiBy { joints, image, goal } psi_by_ = PsiBy::joints;
  Eigen::Vector2d off_px_ = Eigen::Vector2d::Zero();  ///< the seen tip beside the registration's
  std::optional<double> corrected_s_;                 ///< by the image of that stamp
  int registration_ = 0;                              ///< of that image
  DesiredFeatures last_;
};

}  // namespace lapservo::internal
