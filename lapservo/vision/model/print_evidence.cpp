#include "lapservo/vision/model/print_evidence.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace lapservo::internal {
namespace {

const PrintVector& inner_shift() {
  static const PrintVector c = (PrintVector() << 0, 1, 1, 1, 1, 0).finished();
  return c;
}

// For a matrix in which boundaries stand in blocks of their own.
PrintMatrix inverse_by_boundary(const PrintMatrix& information) {
  PrintMatrix inverse = PrintMatrix::Zero();
  for (const auto& [upper, lower] : errors_of_boundary) {
    const double a = information(upper, upper), b = information(upper, lower), c = information(lower, lower);
    if (upper == lower) {
      inverse(upper, upper) = 1 / a;
      continue;
    }
    const double determinant = a * c - b * b;
    inverse(upper, upper) = c / determinant, inverse(lower, lower) = a / determinant;
    inverse(upper, lower) = inverse(lower, upper) = -b / determinant;
  }
  return inverse;
}

// Where the boundaries lie at both edges of the print.
PrintVector places_mm(const Marker& marker) {
  const auto at_upper_m = boundaries_m(marker, 0), slopes_m = boundary_slopes_m(marker);
  PrintVector places_m;
  for (std::size_t k = 0; k < errors_of_boundary.size(); ++k) {
    const auto [upper, lower] = errors_of_boundary[k];
    places_m[lower] = at_upper_m[k] + marker.covered_rad() * slopes_m[k];
    places_m[upper] = at_upper_m[k];
  }
  return m_in_mm * places_m;
}

}  // namespace

PrintShapes shapes_of(const PrintDoubt& doubt, const PrintMatrix& squares, const std::array<double, 4>& weights,
                      const Marker& marker) {
  constexpr double least_variance = 1e-4;
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
    // It leans about the middle of what shows of it, by turn fractions.
    const double both = squares(upper, lower), at_lower = squares(lower, lower);
    const double square = squares(upper, upper) + 2 * both + at_lower, middle = (at_lower + both) / square;
    const double variance = std::max(least_variance, at_lower / square - middle * middle);
    const double mean_square = square / weights[k];
    whole[upper] = whole[lower] = doubt.boundary_px / std::sqrt(mean_square);
    shapes.push_back(whole);
    const double tilt_mm = doubt.tilt_px / std::sqrt(variance * mean_square);
    PrintVector tilted = PrintVector::Zero();
    tilted[upper] = -middle * tilt_mm, tilted[lower] = (1 - middle) * tilt_mm;
    shapes.push_back(tilted);
  }
  return shapes;
}

PrintInformation doubted(PrintInformation print, std::span<const PrintVector> shapes_mm) {
  for (const PrintVector& shape : shapes_mm) {
    const PrintVector seen = print.information.lazyProduct(shape);
    const double certainty = 1 / (1 + shape.dot(seen));
    print.gradient -= certainty * shape.dot(print.gradient) * seen;
    print.information -= (certainty * seen).lazyProduct(seen.transpose());
  }
  return print;
}

PrintMatrix covariance_of(const PrintMatrix& information_by_boundary, const PrintPrior& prior) {
  const double ink = prior.ink_mm * prior.ink_mm, least = ink > 0 ? 1e-6 : 1e-18;
  const double bands = std::max(prior.bands_mm * prior.bands_mm, least);
  PrintMatrix covariance = inverse_by_boundary(information_by_boundary + PrintMatrix::Identity() / bands);
  if (!(ink > 0)) return covariance;
  // The prior's inverse is (I - c c^T / (bands / ink + 4)) / bands.
  const PrintVector moved = covariance * inner_shift();
  covariance += moved * moved.transpose() / (bands * (bands / ink + 4) - inner_shift().dot(moved));
  return covariance;
}

// (g^T R (I + R A R)^-1 R g - log |I + R A R|) / 2, R the root of the prior's covariance: bands I + more c c^T. By
// Gaussian elimination. The pivots are at least 1 but for rounding.
double likelihood_gain(const PrintInformation& print, const PrintPrior& prior) {
  const double bands = prior.bands_mm, more = (std::hypot(bands, 2 * prior.ink_mm) - bands) / 4;
  const PrintVector& c = inner_shift();
  const PrintVector by_ink = print.information * c;
  const PrintVector beside = bands * more * by_ink + 0.5 * more * more * c.dot(by_ink) * c;
  PrintMatrix left = PrintMatrix::Identity() + bands * bands * print.information;
  left += beside * c.transpose() + c * beside.transpose();
  PrintVector gradient = bands * print.gradient + more * c.dot(print.gradient) * c;
  double squares = 0, determinant = 1;
  for (int i = 0; i < print_errors; ++i) {
    const double pivot = std::max(1.0, left(i, i));
    determinant *= pivot;
    squares += gradient[i] * gradient[i] / pivot;
    for (int j = i + 1; j < print_errors; ++j) {
      const double factor = left(j, i) / pivot;
      for (int k = i + 1; k <= j; ++k) left(j, k) -= factor * left(k, i);
      gradient[j] -= factor * gradient[i];
    }
  }
  return 0.5 * (squares - std::log(determinant));
}

}  // namespace lapservo::internal
