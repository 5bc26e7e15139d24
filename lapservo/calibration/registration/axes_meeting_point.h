#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/calibration/registration/timed_pose.h"

namespace lapservo::internal {

/// Where the axes of a shaft that pivots meet: the RCM, in the camera frame.
struct AxesMeetingPoint {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
  std::vector<double> misses_m;  ///< of each axis
  /// Faults of the poses that show beyond the noise, one sentence each, the clearest first, and the mean squares and
  /// products of the error that they make.
  std::vector<std::string> faults;
  Eigen::Matrix3d by_faults = Eigen::Matrix3d::Zero();
};

/// Nullopt when they are too few or too alike.
std::optional<AxesMeetingPoint> axes_meeting_point(const std::vector<TimedPose>& poses,
                                                   const AtIteration& at_iteration = {});

}  // namespace lapservo::internal
