#include "lapservo/vision/model/print_evidence.h"

#include <algorithm>
#include <cmath>

namespace lapservo::internal {
namespace {

const PrintVector& inner_shift() {
  static const PrintVector c = (PrintVector() << 0, 1, 1, 1, 1, 0).finished();
  return c;
}

// (I + c c^T)^(1/2), where |c| is 2.
const PrintMatrix& root_of_ink_aside() {
  static const PrintMatrix root =
      PrintMatrix::Identity() + (std::sqrt(5.0) - 1) / 4 * inner_shift() * inner_shift().transpose();
  return root;
}

// Of a matrix in which boundaries stand in blocks of their own.
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

PrintInformation doubted(PrintInformation print, const PrintShapes& shapes_mm) {
  for (const PrintVector& shape : shapes_mm) {
    const PrintVector seen = print.information.lazyProduct(shape);
    const double certainty = 1 / (1 + shape.dot(seen));
    print.gradient -= certainty * shape.dot(print.gradient) * seen;
    print.information -= (certainty * seen).lazyProduct(seen.transpose());
  }
  return print;
}

PrintMatrix covariance_of(const PrintMatrix& information_by_boundary, const PrintPrior& prior) {
  const double variance = std::max(prior.sigma_mm * prior.sigma_mm, 1e-18);
  PrintMatrix covariance = inverse_by_boundary(information_by_boundary + PrintMatrix::Identity() / variance);
  if (prior.ink_aside) {  // whose prior's inverse is (I - c c^T / 5) / variance
    const PrintVector moved = covariance * inner_shift();
    covariance += moved * moved.transpose() / (5 * variance - inner_shift().dot(moved));
  }
  return covariance;
}

PrintEvidence::PrintEvidence(const PrintInformation& print) : alone_(print) {
  const PrintMatrix& root = root_of_ink_aside();
  ink_aside_.information = root.lazyProduct(print.information.lazyProduct(root).eval());
  ink_aside_.gradient = root.lazyProduct(print.gradient);
}

// (variance g^T (I + variance A)^-1 g - log |I + variance A|) / 2, by Gaussian elimination. The pivots are at least 1
// but for rounding.
double PrintEvidence::gain(const PrintPrior& prior) const {
  const PrintInformation& print = prior.ink_aside ? ink_aside_ : alone_;
  const double variance = prior.sigma_mm * prior.sigma_mm;
  PrintMatrix left = PrintMatrix::Identity() + variance * print.information;
  PrintVector gradient = print.gradient;
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
  return 0.5 * (variance * squares - std::log(determinant));
}

}  // namespace lapservo::internal
