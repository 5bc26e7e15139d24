#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/control/feature_model.h"

namespace lapservo {

/// What one frame tells the controller. The image stamped `time_s` shows the scene at time_s - delay: stamp it when it
/// arrives and the delay is the whole chain's, or when it was exposed and the delay is zero.
struct ImageMeasurement {
  bool found = false;  ///< false: the marker was not seen; nothing else counts then
  double time_s = 0;
  Eigen::Vector4d features = Eigen::Vector4d::Zero();        ///< s_rad, r_px, l_px, d_px on ideal pixels
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Identity();  ///< of the features
  Eigen::Vector4d ends_px = Eigen::Vector4d::Zero();         ///< e0 u, v, e3 u, v
  std::optional<Eigen::Vector4d> q;                          ///< a start for the first frame, when known
};

/// Covariance of features from that of q.
inline Eigen::Matrix4d feature_covariance(const FeatureState& state, const Eigen::Matrix4d& q_covariance) {
  return state.jacobian * q_covariance * state.jacobian.transpose();
}

}  // namespace lapservo
