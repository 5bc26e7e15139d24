#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The joints as the rig reads them and the marker as one image shows it, without the registration.
struct MarkerSighting {
  double time_s = 0;
  Eigen::Vector4d q = Eigen::Vector4d::Zero(), q_rate = Eigen::Vector4d::Zero();  ///< rad, m, and per second
  Rigid3 camera_from_marker;
  std::size_t path_index = 0;  ///< of GapPath
};

/// How rho and psi (m, rad) went since q's offset held, by which it is known to which side of their gaps they press.
struct GapPath {
  Eigen::Vector2i sides = Eigen::Vector2i::Zero();  ///< then: 1 after rising, -1 after falling, 0: not known
  std::vector<Eigen::Vector2d> joints;
};

/// Numbers by which joints and images differ from a rig (rad, m, s): offsets of q; the images' delay; a rotation of
/// camera_from_rcm about the camera's axes and its translation; by how much these six changed; gaps of rho and psi.
namespace arm {
constexpr int offset = 0, delay = 4, rotation = 5, translation = 8, change = 11, gap = 17, numbers = 19;
}
using ArmNumbers = Eigen::Matrix<double, arm::numbers, 1>;
using ArmMatrix = Eigen::Matrix<double, arm::numbers, arm::numbers>;

/// Which of the numbers differ from 0.
struct ArmHypothesis {
  ArmNumbers sigmas = ArmNumbers::Zero();  ///< their standard deviations, as a prior; 0: the number is 0
  std::optional<int> mirrored;             ///< the joint whose sign is wrong
  double from_s = 0, to_s = 0;             ///< of the change
};

struct ArmData {
  const Marker& marker;
  Rigid3 camera_from_rcm;  ///< that the numbers are beside
  const std::vector<MarkerSighting>& sightings;
  /// A matrix for each sighting, that makes errors of unit size of its pose's: a translation [m], then a rotation
  /// vector [rad], in the camera frame.
  std::vector<Eigen::Matrix<double, 6, 6>> whitening{};
  double loss_sigmas = 1e6;  ///< scale of Cauchy's loss of a sighting's errors
  double weight = 1;         ///< of a sighting: below 1 where neighbouring ones share most of their errors
  GapPath path{};            ///< for hypotheses with gaps
};

struct ArmFit {
  ArmNumbers numbers;
  ArmMatrix covariance;
  double rms = 0;         ///< of the sightings' errors: root of the mean of their squared sizes
  double newest_rms = 0;  ///< size of the last sighting's error
  double evidence = 0;    ///< logarithm of the hypothesis' evidence, by Laplace's approximation
};

/// Least squares, by Levenberg and Marquardt's method. Nullopt without sightings and where they do not determine a
/// number.
std::optional<ArmFit> fit_arm(const ArmData& data, const ArmHypothesis& hypothesis,
                              const ArmNumbers& start = ArmNumbers::Zero());

/// From one pose to another: a translation, then a rotation vector, in the camera frame.
Eigen::Matrix<double, 6, 1> pose_difference(const Rigid3& to, const Rigid3& from);

/// camera_from_rcm with the numbers' rotation and translation.
Rigid3 moved_by(const ArmNumbers& numbers, const Rigid3& camera_from_rcm);

}  // namespace lapservo::internal
