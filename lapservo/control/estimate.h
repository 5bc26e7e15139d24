#pragma once

#include <Eigen/Core>

#include "lapservo/control/feature_model.h"

namespace lapservo {

/// The estimated places of the joints in their gaps.
struct GapState {
  Eigen::Vector4d width = Eigen::Vector4d::Zero();  ///< full backlash of each joint
  Eigen::Vector4d shift = Eigen::Vector4d::Zero();  ///< what it adds to the measured joints: -width/2 to width/2
};

/// The instrument now. Its features are unbiased in the image even if the model is wrong.
struct Estimate : FeatureState {
  Eigen::Vector4d q = Eigen::Vector4d::Zero();  ///< measured joints through their backlash, plus offset
  GapState gap{};
  Eigen::Matrix4d q_covariance = Eigen::Matrix4d::Zero();
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();  ///< of the features
};

}  // namespace lapservo
