#pragma once

#include "lapservo/core/random.h"
#include "lapservo/marker/marker.h"
#include "lapservo/testing/ink_aside.h"

namespace lapservo::acceptance {

/// A marker as it is printed, cut and wrapped by hand.
struct Print {
  Marker marker;
  double error_m;  ///< standard deviation of the bands' lengths
};

/// Every band is off independently, at either edge; the last one absorbs the rest, so that the ends stay circles,
/// unless wrapped askew. The seam is off by 0.05 rad, which no image shows.
inline Print random_print(const Marker& nominal, double error_m, bool askew, internal::Random& random) {
  Print print{nominal, error_m};
  auto &upper = print.marker.bands_upper_m, &lower = print.marker.bands_lower_m;
  for (auto* bands : {&upper, &lower})
    for (double& band : *bands) band += error_m * random.normal();
  if (!askew) lower[2] = print.marker.length_m() - lower[0] - lower[1];
  print.marker.seam_rad += 0.05 * random.normal();
  return print;
}

/// How a print is off: each boundary by itself, or inks that were not laid one on the other: the middle band as a
/// whole.
enum class Off { nowhere, bands, middle_ink };

/// One that is off by 0.05 to 0.3 mm in this way.
inline Marker off_print(const Marker& nominal, Off off, internal::Random& random) {
  constexpr double mm = 1e-3;
  const double error_m = random.uniform(0.05 * mm, 0.3 * mm);
  const bool askew = random.uniform() < 0.2;
  if (off == Off::nowhere) return nominal;
  if (off == Off::bands) return random_print(nominal, error_m, askew, random).marker;
  return scenes::with_ink_aside(nominal, random.uniform() < 0.5 ? error_m : -error_m);
}

}  // namespace lapservo::acceptance
