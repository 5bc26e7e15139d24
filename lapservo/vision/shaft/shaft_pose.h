#pragma once

#include <array>
#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/rigid3.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// Where a shaft with its marker is: the unrolled frame (z along the axis to the tip, origin at the marker's proximal
/// end) and the rotation about the axis in its azimuths.
struct ShaftPose {
  Rigid3 camera_from_unrolled;
  double psi_rad = 0;
};

/// Azimuth on the marker of the generatrix that faces the camera, [0, 2 pi). Nullopt where the camera is inside of the
/// shaft.
std::optional<double> facing_tau_rad(const Marker& marker, const ShaftPose& pose);

/// q of the shaft from the RCM to the marker's proximal end, with the pose's rotation about the axis. Nullopt where
/// that end is the RCM.
std::optional<JointVector> configuration_of(const ShaftPose& pose, const Rigid3& camera_from_rcm);

/// Most unknowns of a fit: a pose's six, psi included, and one of the marker.
inline constexpr int max_unknowns = 7;
using UnknownVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_unknowns, 1>;
using UnknownMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_unknowns, max_unknowns>;

/// The unknowns of a fit. With camera_from_rcm they are q = [theta, phi, rho, psi]; without it the axis' five
/// (rotations about the unrolled x and y, translations along x, y and z) and psi.
class PoseUnknowns {
 public:
  static PoseUnknowns rcm(const Rigid3& camera_from_rcm, const JointVector& q);
  static PoseUnknowns free(const ShaftPose& pose);

  int size() const { return camera_from_rcm_ ? 4 : 6; }
  const ShaftPose& pose() const { return pose_; }
  /// Present in the first form.
  const std::optional<JointVector>& q() const { return q_; }

  /// Row d(n . p)/d(unknowns) for a point p (camera frame) that moves with the shaft; psi's entry is 0, and so are
  /// those of as many unknowns `beyond` the pose's.
  UnknownVector row(const Eigen::Vector3d& point_in_camera, const Eigen::Vector3d& direction, int beyond = 0) const;

  /// The pose after a small change of the unknowns.
  PoseUnknowns changed_by(const UnknownVector& step) const;

  /// The same pose with another rotation about the axis.
  PoseUnknowns with_psi(double psi_rad) const;

 private:
  void derive();

  std::optional<Rigid3> camera_from_rcm_;
  std::optional<JointVector> q_;
  ShaftPose pose_;
  Eigen::Vector3d pivot_ = Eigen::Vector3d::Zero();
  // In the order of the unknowns: axes of the two rotations, about the pivot, then directions of the translations.
  std::array<Eigen::Vector3d, 2> rotations_{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  std::array<Eigen::Vector3d, 3> translations_{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                                               Eigen::Vector3d::Zero()};
};

}  // namespace lapservo::internal
