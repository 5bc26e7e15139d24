#pragma once

#include <cstddef>

#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// tau in [0, covered_rad()] from the length of band 0, 1 or 2 along the shaft (eq. 16). The length must be known in
/// metres, and an image shows lengths only as well as depth and inclination are known: trackers read the cross-ratio
/// (CrossRatioDecoder), which needs neither. A length beyond the band's range gives the nearer end, a non-finite one
/// gives NaN. Throws std::invalid_argument where the band is as long at every rotation.
double tau_by_length_rad(const Marker& marker, std::size_t band, double length_m);

}  // namespace lapservo::internal
