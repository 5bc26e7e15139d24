#pragma once

#include <optional>

#include "lapservo/vision/edge_measurements.h"

namespace lapservo::internal {

/// How much psi varied while the shutter was open, by the boundaries' blur: a turn adds psi's variance times the
/// squared steepness [px/rad] of a boundary to its blur's variance, nothing to the ends', and the steeper inner
/// boundary has more of it than the other one.
struct TurnBlur {
  double variance_rad2 = 0;  ///< noise may make it negative
  double sigma_rad2 = 0;     ///< of variance_rad2; 0 where nothing is told
};

/// By a pass whose boundaries were located with this blur. `processed`: the camera does more to its pictures than its
/// response, which blurs each boundary by another width.
TurnBlur turn_blur(const EdgeMeasurements& pass, const EdgeBlur& located_with, bool processed);

/// Variance of psi in the exposure's middle about its mean over the exposure, which is what a picture shows. Psi may
/// have turned evenly, which moves nothing, but the blur does not tell; it is taken for a start from rest. Of single
/// frames most are still: a blur that may be noise does not count. By `change_rad` psi's step from the frame before
/// differs from that before, which bounds it.
double variance_of_uneven_turn(const TurnBlur& blur, std::optional<double> change_rad);

}  // namespace lapservo::internal
