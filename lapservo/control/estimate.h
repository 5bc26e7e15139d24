#pragma once

#include <Eigen/Core>

namespace lapservo {

/// The estimated places of the joints in their gaps.
struct GapState {
  Eigen::Vector4d width = Eigen::Vector4d::Zero();  ///< full backlash of each joint
  Eigen::Vector4d shift = Eigen::Vector4d::Zero();  ///< what it adds to the measured joints: -width/2 to width/2
};

/// The instrument now.
struct Estimate {
  Eigen::Vector4d q = Eigen::Vector4d::Zero();  ///< measured joints through their backlash, plus offset
  GapState gap;
  Eigen::Matrix4d q_covariance = Eigen::Matrix4d::Zero();
  Eigen::Vector4d features = Eigen::Vector4d::Zero();  ///< unbiased in the image even if the model is wrong
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  Eigen::Matrix4d jacobian = Eigen::Matrix4d::Zero();
  Eigen::Vector4d ends_px = Eigen::Vector4d::Zero();
  Eigen::Matrix4d ends_jacobian = Eigen::Matrix4d::Zero();
};

}  // namespace lapservo
