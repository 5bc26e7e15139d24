#pragma once

#include <optional>

#include "lapservo/vision/edges/edge_measurements.h"

namespace lapservo::internal {

/// The evidence of the boundaries' blur about a turn within the exposure. By rendered turns of 0.05 to 0.4 rad.
struct TurnBlurLimits {
  int min_points = 6;  ///< of a boundary
  /// By how much boundaries' blurs differ in still images: unprocessed ones, and in 4:2:0, JPEG (0.1 to 0.5).
  double unexplained_px2 = 0.003, of_processing_px2 = 0.3;
  double told_sigmas = 2.5;  ///< from which on a blur is a turn's and no noise: most frames are still
  /// Of the misfit (chi^2 a degree of freedom, of which there are two at most), what is not taken for chance.
  double misfit_fraction = 0.25;
  /// The most that the middle may be off, by the turn's change: twice what a start from rest in this exposure has.
  double uneven_of_change = 0.5;
};
inline constexpr TurnBlurLimits turn_blur_limits;

/// How much psi varied while the shutter was open, by the boundaries' blur: a turn adds psi's variance times the
/// squared steepness [px/rad] of a boundary to its blur's variance, and nothing to the ends'.
struct TurnBlur {
  double variance_rad2 = 0;  ///< noise may make it negative
  double sigma_rad2 = 0;     ///< of variance_rad2; 0 where nothing is known
};

/// By a pass whose boundaries were located with this blur. `processed`: the camera does more to its images than its
/// response, which blurs each boundary by another width.
TurnBlur turn_blur(const EdgeMeasurements& pass, const EdgeBlur& located_with, bool processed);

/// Variance of psi in the exposure's middle about its mean over the exposure, which is what an image shows. Psi may
/// have turned evenly, which moves nothing, but the blur does not show that; it is taken for a start from rest. By
/// `change_rad` psi's step from the frame before differs from that before, which bounds it; where the blur says
/// nothing, it is that of a start from rest that changes psi so far, and 0 of a frame on its own.
double variance_of_uneven_turn(const TurnBlur& blur, std::optional<double> change_rad);

}  // namespace lapservo::internal
