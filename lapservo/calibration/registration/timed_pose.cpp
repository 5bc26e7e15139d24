#include "lapservo/calibration/registration/timed_pose.h"

namespace lapservo::internal {

std::vector<TimedPose> with_focal(std::vector<TimedPose> poses, double longer) {
  for (TimedPose& pose : poses) {
    const Eigen::Vector3d axis = pose.axis(), along_view(0, 0, axis.z());
    Rigid3& camera_from_marker = pose.marker.camera_from_marker;
    camera_from_marker.translation.z() *= 1 + longer;
    const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(axis, axis + longer * along_view);
    camera_from_marker.rotation = (turn * camera_from_marker.rotation).normalized();
    pose.by_focal = {{0, 0, pose.origin().z()}, pose.axis().cross(Eigen::Vector3d(0, 0, pose.axis().z()))};
  }
  return poses;
}

}  // namespace lapservo::internal
