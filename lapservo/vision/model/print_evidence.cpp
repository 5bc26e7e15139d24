#include "lapservo/vision/model/print_evidence.h"

#include <algorithm>
#include <cmath>

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

}  // namespace

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

PrintEvidence::PrintEvidence(const PrintInformation& print)
    : print_(print), by_ink_(print.information * inner_shift()), ink_(inner_shift().dot(by_ink_)) {}

// (g^T R (I + R A R)^-1 R g - log |I + R A R|) / 2, R the root of the prior's covariance: bands I + more c c^T. By
// Gaussian elimination. The pivots are at least 1 but for rounding.
double PrintEvidence::gain(const PrintPrior& prior) const {
  const double bands = prior.bands_mm, more = (std::hypot(bands, 2 * prior.ink_mm) - bands) / 4;
  const PrintVector& c = inner_shift();
  const PrintVector beside = bands * more * by_ink_ + 0.5 * more * more * ink_ * c;
  PrintMatrix left = PrintMatrix::Identity() + bands * bands * print_.information;
  left += beside * c.transpose() + c * beside.transpose();
  PrintVector gradient = bands * print_.gradient + more * c.dot(print_.gradient) * c;
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
