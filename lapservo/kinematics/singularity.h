#pragma once

#include <string_view>

#include <Eigen/Core>

#include "lapservo/kinematics/feature_map.h"

namespace lapservo {

/// What keeps the image features from steering a configuration.
enum class Singularity {
  none,
  undefined,            ///< there are no features here: see SingularityReport::undefined
  rcm_frame_pole,       ///< phi near 0 or pi: theta and psi turn about the same axis
  foreshortened,        ///< seen nearly end-on (the extended shaft passes close by the camera): l and d shrink
  at_projected_rcm,     ///< e0 is about to cross the projected RCM, where r has a kink and the sign of dr flips
  rotation_not_in_d,    ///< e2 does not move with tau on this marker: psi does not show in d
  tilt_like_insertion,  ///< a tilt and an insertion together leave r and l: two solutions of the inverse merge
};
std::string_view singularity_word(Singularity kind);

struct SingularityReport {
  Singularity kind = Singularity::none;
  Undefined undefined = Undefined::none;  ///< why, for Singularity::undefined

  /// Smallest singular value of the Jacobian in natural units, without dimension: rows s l, r, l, d in pixels per
  /// (focal length / depth of e0), columns as paths in metres: rho theta, rho phi, rho, radius psi. 1 means that the
  /// image moves as much as that of a point that takes the path across the view. 0 where undefined.
  double smallest_singular_value = 0;
  /// The configuration change that the image shows least, as q velocities, of length 1 in those units.
  Eigen::Vector4d least_seen = Eigen::Vector4d::Zero();
};

/// Below this smallest singular value (natural units) a configuration counts as singular. The working region of the
/// paper's trajectory (configs/paper.yaml) stays above 0.35.
inline constexpr double singular_below = 0.01;

/// Why a controller should hold, slow down or damp here. Names the cause when the smallest singular value is below
/// `singular_below`, or when e0 is within one pixel of the projected RCM.
SingularityReport singularity(const ImageModel& model, const RcmCoordinates& q);

}  // namespace lapservo
