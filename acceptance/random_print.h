#pragma once

#include "lapservo/core/random.h"
#include "lapservo/marker/marker.h"

namespace lapservo::acceptance {

/// A marker as it is printed, cut and wrapped by hand.
struct Print {
  Marker marker;
  double error_m;  ///< standard deviation of the bands' lengths
};

/// Every band is off by itself, at either edge; the last takes up what keeps the ends circles, unless wrapped askew.
/// The seam is off by 0.05 rad, which no picture shows.
inline Print random_print(const Marker& nominal, double error_m, bool askew, internal::Random& random) {
  Print print{nominal, error_m};
  auto &upper = print.marker.bands_upper_m, &lower = print.marker.bands_lower_m;
  for (auto* bands : {&upper, &lower})
    for (double& band : *bands) band += error_m * random.normal();
  if (!askew) lower[2] = print.marker.length_m() - lower[0] - lower[1];
  print.marker.seam_rad += 0.05 * random.normal();
  return print;
}

}  // namespace lapservo::acceptance
