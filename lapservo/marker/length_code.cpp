#include "lapservo/marker/length_code.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace lapservo::internal {

double tau_by_length_rad(const Marker& marker, std::size_t band, double length_m) {
  constexpr double min_change = 1e-6;  // of the marker's length: less is rounding
  const double upper_m = marker.bands_upper_m.at(band), change_m = marker.bands_lower_m.at(band) - upper_m;
  if (!(std::abs(change_m) > min_change * marker.length_m()))
    throw std::invalid_argument("band " + std::to_string(band) +
                                " is as long at every rotation: one of its boundaries must slope");
  if (!std::isfinite(length_m)) return std::numeric_limits<double>::quiet_NaN();
  return marker.covered_rad() * std::clamp((length_m - upper_m) / change_m, 0.0, 1.0);
}

}  // namespace lapservo::internal
