#include "lapservo/vision/model/print_doubt.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace lapservo::internal {
namespace {

// Where the boundaries lie at both edges of the print.
PrintVector places_mm(const Marker& marker) {
  const auto at_upper_m = boundaries_m(marker, 0), slopes_m = boundary_slopes_m(marker);
  PrintVector places_m;
  for (std::size_t k = 0; k < errors_of_boundary.size(); ++k) {
    const auto [upper, lower] = errors_of_boundary[k];
    places_m[lower] = at_upper_m[k] + marker.covered_rad() * slopes_m[k];
    places_m[upper] = at_upper_m[k];
  }
  return 1e3 * places_m;
}

// A boundary that leans about the middle of what shows of it.
struct Leaning {
  double middle, variance;  // of turn fractions, by weight
  double mean_square_px2_per_mm2;
};

Leaning leaning_of(double upper, double both, double lower, double weight) {
  constexpr double least_variance = 1e-4;
  const double square = upper + 2 * both + lower, middle = (lower + both) / square;
  return {middle, std::max(least_variance, lower / square - middle * middle), square / weight};
}

}  // namespace

PrintShapes shapes_of(const PrintDoubt& doubt, const PrintMatrix& squares, const std::array<double, 4>& weights,
                      const Marker& marker) {
  PrintShapes shapes;
  shapes.push_back(doubt.length_fraction * places_mm(marker));
  for (std::size_t k = 0; k < errors_of_boundary.size(); ++k) {
    if (!(weights[k] > 0)) continue;
    const auto [upper, lower] = errors_of_boundary[k];
    PrintVector whole = PrintVector::Zero();
    if (upper == lower) {
      whole[upper] = doubt.boundary_px / std::sqrt(squares(upper, upper) / weights[k]);
      shapes.push_back(whole);
      continue;
    }
    const Leaning leaning = leaning_of(squares(upper, upper), squares(upper, lower), squares(lower, lower), weights[k]);
    whole[upper] = whole[lower] = doubt.boundary_px / std::sqrt(leaning.mean_square_px2_per_mm2);
    shapes.push_back(whole);
    const double tilt_mm = doubt.tilt_px / std::sqrt(leaning.variance * leaning.mean_square_px2_per_mm2);
    PrintVector tilted = PrintVector::Zero();
    tilted[upper] = -leaning.middle * tilt_mm, tilted[lower] = (1 - leaning.middle) * tilt_mm;
    shapes.push_back(tilted);
  }
  return shapes;
}

}  // namespace lapservo::internal
