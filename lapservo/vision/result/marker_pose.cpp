#include "lapservo/vision/result/marker_pose.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace lapservo::internal {

Observation::MarkerPose marker_pose_of(const Marker& marker, const PoseUnknowns& unknowns,
                                       const PoseMatrix& covariance) {
  const ShaftPose& pose = unknowns.pose();
  Observation::MarkerPose result;
  result.camera_from_marker = camera_from_marker(marker, pose.camera_from_unrolled, pose.psi_rad);
  Eigen::Quaterniond& rotation = result.camera_from_marker.rotation;
  if (rotation.w() < 0) rotation.coeffs() *= -1;  // one of the two that mean the same
  const Eigen::Vector3d& origin = result.camera_from_marker.translation;
  const Eigen::Matrix3d axes = result.camera_from_marker.rotation.toRotationMatrix();
  // The origin's rows, then those of the rotation that turns the three axes as they turn.
  PoseMatrix jacobian = PoseMatrix::Zero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Vector3d direction = Eigen::Vector3d::Unit(i);
    const PoseVector of_origin = unknowns.row(origin, direction).head<pose_unknowns>();
    jacobian.row(i) = of_origin;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const PoseVector of_end = unknowns.row(origin + axes.col(axis), direction).head<pose_unknowns>();
      jacobian.bottomRows<3>() += axes.col(axis).cross(direction) * (of_end - of_origin).transpose() / 2;
    }
  }
  jacobian.col(psi_unknown).tail<3>() += axes.col(2);
  result.covariance = jacobian * covariance * jacobian.transpose();
  const Eigen::Matrix3d turns = result.covariance.bottomRightCorner<3, 3>();
  const double roll_variance = axes.col(2).dot(turns * axes.col(2));
  result.sigma_xy_m = std::sqrt((result.covariance(0, 0) + result.covariance(1, 1)) / 2);
  result.sigma_z_m = std::sqrt(result.covariance(2, 2));
  result.sigma_axis_rad = std::sqrt(std::max(0.0, turns.trace() - roll_variance));
  result.sigma_roll_rad = std::sqrt(roll_variance);
  return result;
}

}  // namespace lapservo::internal
