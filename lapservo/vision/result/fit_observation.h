#pragma once

#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/shaft/scene.h"

namespace lapservo::internal {

/// A fit that was accepted, as the user sees it: Status::ok, or Status::poor_fit where the pose shows no centre line.
Observation observation_of(const Scene& scene, const FineFit& fit);

/// An observation of this status, with the pose that was refused.
Observation refused_observation(Status why, const ShaftPose& pose);

}  // namespace lapservo::internal
