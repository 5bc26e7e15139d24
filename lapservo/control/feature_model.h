#pragma once

#include <functional>
#include <optional>

#include <Eigen/Core>

namespace lapservo {

/// The features that the camera sees at q = [theta_rad, phi_rad, rho_m, psi_rad], and their derivatives by q. Pixels
/// are ideal.
struct FeatureState {
  Eigen::Vector4d features = Eigen::Vector4d::Zero();       ///< s_rad, r_px, l_px, d_px
  Eigen::Matrix4d jacobian = Eigen::Matrix4d::Zero();       ///< d features / d q (eq. 20)
  Eigen::Vector4d ends_px = Eigen::Vector4d::Zero();        ///< the marker's end points: u and v of e0, u and v of e3
  Eigen::Matrix4d ends_jacobian = Eigen::Matrix4d::Zero();  ///< d ends / d q
};

/// nullopt where the camera sees no features: behind it, or beyond what the model covers. Any map will do: an exact
/// one, a wrong one, or one learnt online.
using FeatureModel = std::function<std::optional<FeatureState>(const Eigen::Vector4d& q)>;

}  // namespace lapservo
