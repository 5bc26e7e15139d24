#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/rig/rig.h"
#include "lapservo/servo/sighting_fit.h"

namespace lapservo::internal {

struct RegistrationFit {
  Rigid3 camera_from_rcm;
  /// Covariance of its translation [m], then of a rotation vector about the camera's axes [rad].
  Eigen::Matrix<double, 6, 6> covariance;
  double rms_px = 0;         ///< of the images of the marker's four boundaries, each coordinate
  double newest_rms_px = 0;  ///< of the last sighting's alone
};

/// The offset from measured joints at which the boundaries' images show the instrument, whose shaft passes the RCM.
struct SeenJoints {
  Eigen::Vector4d offset = Eigen::Vector4d::Zero();      ///< theta, phi (rad), rho (m), psi (rad)
  Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();  ///< by the images' noise alone
  double misfit_rad = 0;  ///< angle between the images at that offset and those seen: root of the sum of their squares
  /// Symmetric, rad/m: times an error of the RCM's place in the camera frame, a vector as long as its misfit.
  Eigen::Matrix3d misfit_per_m = Eigen::Matrix3d::Zero();
};

/// From `offset` on. Nullopt where the marker's boundaries do not show it.
std::optional<SeenJoints> seen_joints(const Camera& camera, const Instrument& instrument,
                                      const MarkerSighting& sighting, const Eigen::Vector4d& offset);

/// The misfit here that an error of the RCM's place explains: that of `agreed`, and three standard deviations of its
/// change from there. A registration without standard deviations counts as known to 3 mm.
double largest_misfit_rad(const Instrument& instrument, const SeenJoints& agreed, const SeenJoints& here);

/// camera_from_rcm by the boundaries' images where the joints are known to small offsets of phi, rho and psi, the delay
/// and the gaps of rho and psi. Nullopt where the sightings do not determine it.
std::optional<RegistrationFit> fit_registration(const Camera& camera, const Marker& marker,
                                                const std::vector<MarkerSighting>& sightings, const GapPath& path);

}  // namespace lapservo::internal
