#pragma once

#include <vector>

#include <Eigen/Core>

#include "lapservo/kinematics/feature_map.h"

namespace lapservo {

/// Every configuration whose image features are `f` = [s_rad r_px l_px d_px], with rho above 0 and the marker in front
/// of the camera; psi and theta in [-pi, pi), phi in [0, pi]. Exact to rounding, needs no start, and misses none:
/// features fix the image of the marker up to the side of the RCM that it lies on; then the plane through the camera
/// centre and the shaft is known, the length L of the marker between two known rays gives a quartic in the tangent of
/// half the shaft's inclination in that plane, and rho, tau and psi follow one after the other.
///
/// How many there are: at most eight (two sides, four roots each). Where the RCM lies well outside the view there is
/// one: always on configs/paper.yaml and with the RCM behind the camera (20000 seeded configurations each). With the
/// RCM inside the view 7 % have two to four, because a shaft tilted towards the camera and inserted less can look the
/// same; they merge where the Jacobian is singular (Singularity::tilt_like_insertion). d gives one tau, since the
/// boundary e2 is linear in it. None when f can't be reached, or when e2 does not move with tau.
std::vector<RcmCoordinates> inverse_feature_map(const ImageModel& model, const Eigen::Vector4d& f);

/// The same configuration of the instrument written as close to `reference` as it can be: angles with whole turns
/// added, or (theta + pi, -phi, psi + pi).
RcmCoordinates equivalent_nearest(const RcmCoordinates& q, const RcmCoordinates& reference);

/// Bounds of each coordinate, inclusive.
struct RcmLimits {
  RcmCoordinates lower, upper;

  bool contain(const RcmCoordinates& q) const {
    return (q.vector().array() >= lower.vector().array()).all() && (q.vector().array() <= upper.vector().array()).all();
  }
};

/// Why there is no single answer within the limits.
enum class InverseStatus {
  ok,
  unreachable,     ///< no configuration shows these features
  outside_limits,  ///< some do, but none within the limits
  ambiguous,       ///< several within the limits; the nearest to the reference is given
};

struct InverseResult {
  InverseStatus status = InverseStatus::unreachable;
  RcmCoordinates q;  ///< for ok and ambiguous; for outside_limits the one nearest to the reference; else unset
};

/// The configuration within `limits` that shows `f` and lies nearest to `reference` (weights: radians, and rho by its
/// share of the reference's). A psi range of more than one turn holds one configuration several times: the nearest
/// turn counts, and is not called ambiguous.
InverseResult inverse_within(const ImageModel& model, const Eigen::Vector4d& f, const RcmLimits& limits,
                             const RcmCoordinates& reference);

}  // namespace lapservo
