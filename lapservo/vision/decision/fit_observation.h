#pragma once

#include <optional>

#include "lapservo/marker/marker.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/shaft/scene.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// The marker's pose where the unknowns have the shaft, and how sure it is by their covariance; to first order.
Observation::MarkerPose marker_pose_of(const Marker& marker, const PoseUnknowns& unknowns,
                                       const PoseMatrix& covariance);

/// A fit that was accepted, as the user sees it: Status::ok, or Status::poor_fit where the pose shows no centre line.
Observation observation_of(const Scene& scene, const FineFit& fit);

/// An observation of this status, with the pose that was refused, if there was one.
Observation refused_observation(Status why, const std::optional<ShaftPose>& pose = std::nullopt);

}  // namespace lapservo::internal
