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

/// camera_from_rcm by the boundaries' images where the joints are known to small offsets of phi, rho and psi, the delay
/// and the gaps of rho and psi. Nullopt where the sightings do not determine it.
std::optional<RegistrationFit> fit_registration(const Camera& camera, const Marker& marker,
                                                const std::vector<MarkerSighting>& sightings, const GapPath& path);

}  // namespace lapservo::internal
