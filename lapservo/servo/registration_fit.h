#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/control/image_measurement.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The marker in one image, and where the instrument was then by the joints, as far as these are known.
struct MarkerSighting {
  Eigen::Matrix<double, 8, 1> edges_px;                                           ///< e0..e3 u, v on ideal pixels
  Rigid3 camera_from_marker;                                                      ///< by the image alone
  Eigen::Vector4d q = Eigen::Vector4d::Zero(), q_rate = Eigen::Vector4d::Zero();  ///< rad, m, and per second
  std::size_t path_index = 0;                                                     ///< of GapPath
};

/// How rho and psi (m, rad) went since q's offset held, by which it is known to which side of their gaps they press.
struct GapPath {
  Eigen::Vector2i sides = Eigen::Vector2i::Zero();  ///< then: 1 after rising, -1 after falling, 0: not known
  std::vector<Eigen::Vector2d> joints;
};

/// Unknown parts of q, one standard deviation; theta's offset is camera_from_rcm's.
struct RegistrationPrior {
  double phi_rad = 3e-3, rho_m = 3e-4, psi_rad = 0.02;
  double delay_s = 0.01;
  double rho_backlash_m = 2e-4, psi_backlash_rad = 0.03;  ///< beyond what q has crossed
};

struct RegistrationFit {
  Rigid3 camera_from_rcm;
  /// Covariance of its translation [m], then of a rotation vector about the camera's axes [rad].
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double rms_px = 0;              ///< of the edges' coordinates
  double newest_rms_px = 0;       ///< of the last sighting's alone
  double sigma_position_m = 0;    ///< of the RCM: root of the squares' sum
  double sigma_rotation_rad = 0;  ///< of the angle between the true rotation and this
};

/// Where the sighting alone puts the RCM frame.
Rigid3 camera_from_rcm_by(const Marker& marker, const MarkerSighting& sighting);

/// Least squares over the edges' images, with a Cauchy loss, from `start`: camera_from_rcm and, with priors, offsets of
/// phi, rho, psi, the delay, and the backlash of rho and psi. Nullopt where the marker leaves the view or the sightings
/// do not determine a number.
std::optional<RegistrationFit> fit_registration(const Camera& camera, const Marker& marker,
                                                const std::vector<MarkerSighting>& sightings, const GapPath& path,
                                                const Rigid3& start, const RegistrationPrior& prior = {});

}  // namespace lapservo::internal
