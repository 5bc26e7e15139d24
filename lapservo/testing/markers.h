#pragma once

#include <array>

#include "lapservo/core/random.h"
#include "lapservo/marker/marker.h"

namespace lapservo::testing {
using namespace internal;

inline Marker marker_with(const std::array<double, 3>& upper_m, const std::array<double, 3>& lower_m) {
  return {.diameter_m = 0.0084, .bands_upper_m = upper_m, .bands_lower_m = lower_m};
}

/// l1 : l2 constant: both inner boundaries, extended, meet on the proximal end.
inline Marker random_linear_marker(Random& random) {
  const double ratio = random.uniform(0.3, 3), length_m = random.uniform(0.01, 0.05);
  const auto bands = [&](double proximal_fraction) {
    const double proximal_m = proximal_fraction * length_m, l1 = proximal_m * ratio / (1 + ratio);
    return std::array<double, 3>{l1, proximal_m - l1, length_m - proximal_m};
  };
  const double a = random.uniform(0.15, 0.45), b = random.uniform(0.55, 0.85);
  return random.uniform() < 0.5 ? marker_with(bands(a), bands(b)) : marker_with(bands(b), bands(a));
}

inline std::array<double, 3> random_bands(double length_m, Random& random) {
  const double a = random.uniform(0.1, 1), b = random.uniform(0.1, 1), c = random.uniform(0.1, 1);
  const double scale = length_m / (a + b + c);
  return {a * scale, b * scale, c * scale};
}

/// Any bands of equal sums; many are not decodable.
inline Marker random_marker(Random& random) {
  const double length_m = random.uniform(0.01, 0.05);
  const auto upper_m = random_bands(length_m, random);
  return marker_with(upper_m, random_bands(length_m, random));
}

/// Wrapped askew, cut askew, with a gap.
inline Marker askew(Marker marker, Random& random) {
  marker.wrap_m = random.uniform(-2e-3, 2e-3), marker.gap_rad = random.uniform(0, 0.5);
  marker.skew_m = random.uniform(-1e-3, 1e-3), marker.bands_lower_m[2] += marker.skew_m;
  return marker;
}

}  // namespace lapservo::testing
