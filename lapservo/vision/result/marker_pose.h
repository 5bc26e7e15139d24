#pragma once

#include "lapservo/marker/marker.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// The marker's pose where the unknowns have the shaft, and how sure it is by their covariance; to first order.
Observation::MarkerPose marker_pose_of(const Marker& marker, const PoseUnknowns& unknowns,
                                       const PoseMatrix& covariance);

}  // namespace lapservo::internal
