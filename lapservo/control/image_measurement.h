#pragma once

#include <optional>
#include <string_view>

#include <Eigen/Core>

#include "lapservo/control/feature_model.h"
#include "lapservo/geometry/rigid3.h"

namespace lapservo {

/// Whether an image equals the previous one in every pixel.
enum class Repetition {
  none,               ///< it differs
  possible_at_rest,   ///< the same, and it is not known that the camera's noise forbids that
  of_a_noisy_camera,  ///< the same, which noise never lets a new exposure be
};
/// "none", "possible_at_rest", "of_a_noisy_camera"; nullopt for anything else.
std::string_view to_string(Repetition repetition);
std::optional<Repetition> repetition_from_string(std::string_view word);

/// The measurement that one frame gives the controller. The image stamped `time_s` shows the scene at time_s - delay:
/// stamp it on arrival if the delay is that of the whole chain, or at exposure if the delay is zero.
struct ImageMeasurement {
  bool found = false;  ///< false: the marker was not seen; nothing else counts then
  double time_s = 0;
  Eigen::Vector4d features = Eigen::Vector4d::Zero();        ///< s_rad, r_px, l_px, d_px on ideal pixels
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Identity();  ///< of the features
  Eigen::Vector4d ends_px = Eigen::Vector4d::Zero();         ///< e0 u, v, e3 u, v
  std::optional<Eigen::Vector4d> q;                          ///< a start for the first frame, when known
  std::optional<Rigid3> camera_from_marker{};  ///< also where `found` is false because nobody knows where the RCM is
  int registration = 0;                        ///< which camera_from_rcm it was seen with: ServoDecision::registration
  Repetition repetition = Repetition::none;
};

/// Covariance of features from that of q.
inline Eigen::Matrix4d feature_covariance(const FeatureState& state, const Eigen::Matrix4d& q_covariance) {
  return state.jacobian * q_covariance * state.jacobian.transpose();
}

}  // namespace lapservo
