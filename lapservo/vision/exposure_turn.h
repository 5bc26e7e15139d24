#pragma once

#include "lapservo/marker/marker.h"
#include "lapservo/vision/edge_measurements.h"

namespace lapservo::internal {

/// By how much the marker turned about its axis while the shutter was open [rad], as the blur of its boundaries tells;
/// evenly, or else what spreads the rotation as much. A turn blurs each inner boundary in proportion to its slope and
/// the ends not at all; chroma filters blur both inner boundaries alike, a lens all four, motion across the axis the
/// sides most. 0 where the turn isn't what blurs, or the inner boundaries' slopes differ too little to tell. Rendered
/// frames without a turn have up to 0.06, defocused ones (2.2 px) 0.11. `blur`: with which the edges were located.
double exposure_turn_rad(const Marker& marker, const EdgeMeasurements& edges, const EdgeBlur& blur);

}  // namespace lapservo::internal
