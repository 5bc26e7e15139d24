#pragma once

#include <array>

#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// Lengths of the three bands on a line along the shaft, as fractions of the length from the first boundary to the
/// last.
using BandShares = std::array<double, 3>;

/// Whether the marker has these at some azimuth, within 0.06: perspective changes them by some 0.02.
bool has_band_shares(const Marker& marker, const BandShares& seen);

}  // namespace lapservo::internal
