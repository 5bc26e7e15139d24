#pragma once

#include <array>
#include <span>

#include <Eigen/Core>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

inline constexpr double m_in_mm = 1e3, mm_in_m = 1 / m_in_mm;

/// Where a print's boundaries may lie elsewhere than the rig says [mm, distal]: e0, e1 at both edges of the print, e2
/// at both edges, e3: the ends are circles.
inline constexpr int print_errors = 6;
using PrintVector = Eigen::Matrix<double, print_errors, 1>;
using PrintMatrix = Eigen::Matrix<double, print_errors, print_errors>;

/// Which of them boundary 0..3 has at its upper and at its lower edge (tau = 0 and tau -> 2 pi).
inline constexpr std::array<std::array<int, 2>, 4> errors_of_boundary{{{0, 0}, {1, 2}, {3, 4}, {5, 5}}};

/// The residuals' evidence about the print's errors x [mm]: the likelihood exp(gradient . x - x . information x / 2).
struct PrintInformation {
  PrintMatrix information = PrintMatrix::Zero();  ///< positive semi-definite
  PrintVector gradient = PrintVector::Zero();
};

/// How an image that is blurred, compressed or processed moves boundaries as a print's errors would, one sigma each:
/// every boundary as a whole, the inner ones about their middle (rms over what shows), all as of a longer marker.
struct PrintDoubt {
  double boundary_px = 0, tilt_px = 0, length_fraction = 0;
};

/// Errors of the print [mm] by one sigma of what is uncertain, independent of each other.
using PrintShapes = InplaceVector<PrintVector, 7>;

/// `squares_px2_per_mm2`: the weighted squares of d(residual)/d(print's errors) summed over all measurements, `weights`
/// the sum of each boundary's weights: a boundary without any has no uncertainty.
PrintShapes shapes_of(const PrintDoubt& doubt, const PrintMatrix& squares_px2_per_mm2,
                      const std::array<double, 4>& weights, const Marker& marker);

/// Their evidence when such shapes of unknown size (one sigma each) may be in them: the covariance that the information
/// stands for grows by them (the Woodbury identity, a shape at a time).
PrintInformation doubted(PrintInformation print, std::span<const PrintVector> shapes_mm);

/// How large the print's errors are (one sigma) [mm]: each by itself, and both inner boundaries' alike, since the
/// middle ink lies aside, which looks most like a turn. Their covariance is bands^2 I + ink^2 c c^T, c the inner
/// boundaries' shift.
struct PrintPrior {
  double bands_mm = 0, ink_mm = 0;
};

/// The covariance of the print's errors that a prior and the information, in which no boundary has to do with another,
/// leave [mm^2]. Bands are taken to be off by a picometre at least, by a micrometre where the ink lies aside.
PrintMatrix covariance_of(const PrintMatrix& information_by_boundary, const PrintPrior& prior);

/// How likely residuals make a print of such a size of errors, by an exact one: the logarithm of the ratio.
double likelihood_gain(const PrintInformation& print, const PrintPrior& prior);

}  // namespace lapservo::internal
