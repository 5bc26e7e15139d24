#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/rig/rig.h"
#include "lapservo/servo/servo_decision.h"
#include "lapservo/stream/endoscope_pose.h"

namespace lapservo::internal {

/// The instrument before a camera that moved: camera_from_rcm, and its covariance with what the motion adds, 1 % of its
/// angle and of its way.
Instrument before_moved_camera(Instrument first, const Rigid3& first_from_camera);

/// Carries what a moving camera sees, and what is desired of its image, to the image of the camera in its first place:
/// there images move as the joints do, and a goal that stays in the moving image moves.
class MovingCamera {
 public:
  /// The rig's first instrument needs camera_from_rcm. `endoscope` must outlive it.
  MovingCamera(const EndoscopePose& endoscope, const Rig& rig, const Scales& scales);

  /// The input's image, exposed at `first_from_camera`, and the desired features at `since_s` of the trajectory. Where
  /// the endoscope's place is not known, or no q shows the goal there, the image is dropped and the goal rests.
  void carry(ServoInput& input, double since_s, const Trajectory& trajectory, const Rigid3& first_from_camera);

  /// The registration of the camera in its place at that time, where both are known.
  std::optional<Rigid3> camera_from_rcm(double time_s) const;

  /// Another registration of the camera in its first place; without one only the marker's pose is carried.
  void use(const std::optional<Rigid3>& first_from_rcm);

 private:
  void carry(ImageMeasurement& image, const Rigid3& first_from_camera, const Eigen::Vector4d& q) const;
  std::optional<Eigen::Vector4d> features_in_first(double time_s, const Eigen::Vector4d& desired);

  const EndoscopePose& endoscope_;
  Rig rig_;
  Scales scales_;
  std::optional<Rigid3> first_from_rcm_;
  FeatureModel first_;                                ///< of the camera in its first place
  Eigen::Vector4d wanted_ = Eigen::Vector4d::Zero();  ///< q of the goal, from which it is looked for
  DesiredFeatures last_;
  bool begun_ = false;
};

}  // namespace lapservo::internal
