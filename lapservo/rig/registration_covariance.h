#pragma once

#include <string>

#include <Eigen/Core>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Covariance of camera_from_rcm: its translation [m], then a rotation vector about the camera's axes [rad]. The rig's,
/// else by its sigmas, which know no correlations; zero of what it has none of.
Eigen::Matrix<double, 6, 6> registration_covariance(const Instrument& instrument);

/// One line where camera_from_rcm counts as exact, since the rig has no standard deviations of it; else empty.
std::string exact_registration_text(const Instrument& instrument);

/// registration_covariance() of a covariance of a rotation about the RCM frame's own axes, then of the translation.
Eigen::Matrix<double, 6, 6> in_camera_axes(const Rigid3& camera_from_rcm,
                                           const Eigen::Matrix<double, 6, 6>& of_rotation_and_translation);

/// How track, check and servo name images that contradict camera_from_rcm, and what to do.
inline constexpr auto misses_rcm_text = "the shaft misses the rig's RCM";
inline constexpr auto measure_registration_text = "lapservo calibrate registration measures camera_from_rcm";

}  // namespace lapservo::internal
