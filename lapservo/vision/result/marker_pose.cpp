#include "lapservo/vision/result/marker_pose.h"

#include <cmath>

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
  const auto variance = [&covariance](const PoseVector& row) { return row.dot(covariance * row); };
  const auto of_point = [&](const Eigen::Vector3d& point, const Eigen::Vector3d& direction) -> PoseVector {
    return unknowns.row(point, direction).head<pose_unknowns>();
  };
  const auto of_origin = [&](const Eigen::Vector3d& direction) { return of_point(origin, direction); };
  // How the end of one of the marker's unit axes moves against its origin.
  const auto of_axis = [&](int axis, const Eigen::Vector3d& direction) -> PoseVector {
    return of_point(origin + axes.col(axis), direction) - of_origin(direction);
  };
  PoseVector by_roll = of_axis(0, axes.col(1));
  by_roll[psi_unknown] = 1;
  result.sigma_xy_m =
      std::sqrt((variance(of_origin(Eigen::Vector3d::UnitX())) + variance(of_origin(Eigen::Vector3d::UnitY()))) / 2);
  result.sigma_z_m = std::sqrt(variance(of_origin(Eigen::Vector3d::UnitZ())));
  result.sigma_axis_rad = std::sqrt(variance(of_axis(2, axes.col(0))) + variance(of_axis(2, axes.col(1))));
  result.sigma_roll_rad = std::sqrt(variance(by_roll));
  return result;
}

}  // namespace lapservo::internal
