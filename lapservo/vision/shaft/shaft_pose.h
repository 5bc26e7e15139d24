#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/geometry/camera.h"
#include "lapservo/geometry/cylinder.h"
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

/// Points of the shaft in the camera's frame, `along_m` from the marker's proximal end: on its axis, on its surface.
inline Eigen::Vector3d point_on_axis(const ShaftPose& pose, double along_m) {
  return pose.camera_from_unrolled * Eigen::Vector3d(0, 0, along_m);
}
inline Eigen::Vector3d point_on(const ShaftPose& pose, const Marker& marker, double azimuth_rad, double along_m) {
  return pose.camera_from_unrolled * surface_point(marker.radius_m(), azimuth_rad, along_m);
}

/// The direction of the axis in the camera's frame, to the tip; and how many pixels of the raw image a metre along it
/// takes at a point of the shaft.
inline Eigen::Vector3d axis_of(const ShaftPose& pose) {
  return pose.camera_from_unrolled.rotation * Eigen::Vector3d::UnitZ();
}
inline double px_per_m_along(const Camera& camera, const ShaftPose& pose, const Eigen::Vector3d& point) {
  return (camera.raw_with_jacobian(point).d_px_d_point * axis_of(pose)).norm();
}

/// Azimuth on the marker of the generatrix that faces the camera, [0, 2 pi). Nullopt for a camera inside of the shaft.
std::optional<double> facing_tau_rad(const Marker& marker, const ShaftPose& pose);

/// For the shaft through the RCM.
ShaftPose pose_through_rcm(const Rigid3& camera_from_rcm, const JointVector& q);

/// q of the shaft from the RCM to the marker's proximal end, with the pose's rotation. Nullopt where that is the RCM.
std::optional<JointVector> configuration_of(const ShaftPose& pose, const Rigid3& camera_from_rcm);

/// Unknowns of a fit, in this order: rotations about the unrolled frame's x and y [rad], translations along its x, y
/// and z [m], psi [rad], and of a fine fit the film's thickness (film_sigma_m).
inline constexpr int pose_unknowns = 6, fit_unknowns = 7, psi_unknown = 5, film_unknown = 6;
using PoseVector = Eigen::Matrix<double, pose_unknowns, 1>;
using PoseMatrix = Eigen::Matrix<double, pose_unknowns, pose_unknowns>;
using UnknownVector = Eigen::Matrix<double, fit_unknowns, 1>;
using UnknownMatrix = Eigen::Matrix<double, fit_unknowns, fit_unknowns>;

/// A pose that is fitted.
class PoseUnknowns {
 public:
  PoseUnknowns() = default;
  /// `through_rcm`: whether the scene's registration holds the shaft at the RCM (RcmPrior).
  PoseUnknowns(const ShaftPose& pose, bool through_rcm);

  const ShaftPose& pose() const { return pose_; }
  bool through_rcm() const { return through_rcm_; }

  /// Row d(n . p)/d(unknowns) for a point p (camera frame) that moves with the shaft; 0 for psi and the film.
  UnknownVector row(const Eigen::Vector3d& point_in_camera, const Eigen::Vector3d& direction) const;

  /// The pose after a small change of the unknowns.
  PoseUnknowns changed_by(const PoseVector& step) const;
  /// The change that leads from here to a pose near by, to second order.
  PoseVector change_to(const PoseUnknowns& other) const;

  /// The same pose with another rotation about the axis.
  PoseUnknowns with_psi(double psi_rad) const { return {{pose_.camera_from_unrolled, psi_rad}, through_rcm_}; }
  PoseUnknowns with_rcm(bool through_rcm) const { return {pose_, through_rcm}; }

 private:
  ShaftPose pose_;
  bool through_rcm_ = false;
  Eigen::Matrix3d axes_ = Eigen::Matrix3d::Identity();  ///< of the unrolled frame, in the camera's
};

}  // namespace lapservo::internal
