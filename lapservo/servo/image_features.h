#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/control/feature_model.h"
#include "lapservo/control/image_measurement.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"

namespace lapservo {

/// The rig's first instrument as the controller knows it: q to image features with their derivatives (eq. 12-15, 20).
/// Empty when the rig has no camera_from_rcm.
FeatureModel feature_model(const Rig& rig);

/// The same, were its camera_from_rcm that one.
FeatureModel feature_model(const Rig& rig, const std::optional<Rigid3>& camera_from_rcm);

/// The controller's measurement from an observation. Valid only when all four features are known, r from `rcm_px`, the
/// RCM's image in ideal pixels. The covariance is that of the fitted points, propagated to the features: the RCM counts
/// as exact, as the controller's model has the same one.
ImageMeasurement measurement_of(const Observation& observation, double stamp_s,
                                const std::optional<Eigen::Vector2d>& rcm_px);

/// The RCM's image by the rig's first instrument; where that has no camera_from_rcm, `estimated_px` (see estimate-rcm).
std::optional<Eigen::Vector2d> rcm_image_px(const Rig& rig, const std::optional<Eigen::Vector2d>& estimated_px);

}  // namespace lapservo
