#include "lapservo/calibration/marker/print_shape.h"

#include <cmath>
#include <cstddef>

#include "lapservo/core/rounded_sigma.h"
#include "lapservo/marker/sensitivity.h"

namespace lapservo::internal {
namespace {

// d(a number of the rig)/d(print_numbers).
PrintNumbers unit(int number) {
  return number < 0 ? PrintNumbers::Zero() : PrintNumbers(PrintNumbers::Unit(number));
}
PrintNumbers upper_row(int boundary) {
  return unit(boundary - 1);
}
PrintNumbers lower_row(int boundary) {
  return unit(3 + boundary);
}

}  // namespace

PrintShape PrintShape::of(const Marker& marker) {
  PrintShape shape;
  shape.upper_m = boundaries_m(marker, 0);
  const auto slopes_m = boundary_slopes_m(marker);
  for (std::size_t k = 0; k < 4; ++k) shape.lower_m[k] = shape.upper_m[k] + slopes_m[k] * marker.covered_rad();
  shape.gap_rad = marker.gap_rad;
  return shape;
}

Marker PrintShape::on(Marker marker) const {
  for (std::size_t i = 0; i < 3; ++i) {
    marker.bands_upper_m[i] = upper_m[i + 1] - upper_m[i];
    marker.bands_lower_m[i] = lower_m[i + 1] - lower_m[i];
  }
  marker.wrap_m = lower_m[0];
  marker.skew_m = lower_m[3] - lower_m[0] - upper_m[3];
  marker.gap_rad = gap_rad;
  return marker;
}

PrintShape changed_by(const PrintShape& shape, const PrintNumbers& change) {
  PrintShape changed = shape;
  for (int k = 0; k < 4; ++k) {
    if (k > 0) changed.upper_m[static_cast<std::size_t>(k)] += change[k - 1];
    changed.lower_m[static_cast<std::size_t>(k)] += change[3 + k];
  }
  changed.gap_rad += change[7];
  return changed;
}

MarkerSigmas sigmas_of(const PrintCovariance& covariance, MarkerSigmas others) {
  const auto sigma = [&](const PrintNumbers& row) { return rounded_sigma(std::sqrt(row.dot(covariance * row))); };
  std::array<double, 3> upper{}, lower{};
  for (int i = 0; i < 3; ++i) {
    upper[static_cast<std::size_t>(i)] = sigma(upper_row(i + 1) - upper_row(i));
    lower[static_cast<std::size_t>(i)] = sigma(lower_row(i + 1) - lower_row(i));
  }
  others.bands_upper_m = upper, others.bands_lower_m = lower;
  others.wrap_m = sigma(lower_row(0));
  others.skew_m = sigma(lower_row(3) - lower_row(0) - upper_row(3));
  others.gap_rad = sigma(unit(7));
  return others;
}

double tolerance_of(const PrintShape& shape, const PrintCovariance& covariance, const Marker& marker) {
  constexpr int steps = 36;
  const Marker printed = shape.on(marker);
  double variance = 0, of_a_metre = 0;
  for (int i = 0; i < steps; ++i) {
    const double fraction = (i + 0.5) / steps, tau_rad = fraction * printed.covered_rad();
    const auto by_boundaries = tau_by_boundaries(printed, tau_rad);
    PrintNumbers row = PrintNumbers::Zero();
    for (int k = 0; k < 4; ++k)
      row += by_boundaries[static_cast<std::size_t>(k)] * ((1 - fraction) * upper_row(k) + fraction * lower_row(k));
    variance += row.dot(covariance * row);
    const double unit_rad = predicted_print_error_rad(printed, tau_rad, 1);
    of_a_metre += unit_rad * unit_rad;
  }
  return rounded_sigma(std::sqrt(variance / of_a_metre));
}

}  // namespace lapservo::internal
