#pragma once

#include <array>

#include <Eigen/Core>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// Where a print's boundaries may lie elsewhere than the rig says [mm, distal]: e0, e1 at both edges of the print, e2
/// at both edges, e3: the ends are circles.
inline constexpr int print_errors = 6;
using PrintVector = Eigen::Matrix<double, print_errors, 1>;
using PrintMatrix = Eigen::Matrix<double, print_errors, print_errors>;

/// Which of them boundary 0..3 has at its upper and at its lower edge (tau = 0 and tau -> 2 pi).
inline constexpr std::array<std::array<int, 2>, 4> errors_of_boundary{{{0, 0}, {1, 2}, {3, 4}, {5, 5}}};

/// How an image that is blurred, compressed or processed moves boundaries as a print's errors would, one sigma each:
/// every boundary as a whole, the inner ones about their middle (rms over what shows), and all as if the marker were
/// longer by this fraction.
struct PrintDoubt {
  double boundary_px = 0, tilt_px = 0, length_fraction = 0;
};

/// Errors of the print [mm] by one sigma of what is uncertain, independent of each other.
using PrintShapes = InplaceVector<PrintVector, 7>;

/// `squares_px2_per_mm2`: the weighted squares of d(residual)/d(print's errors) summed over all measurements, `weights`
/// the sum of each boundary's weights: a boundary without any has no uncertainty.
PrintShapes shapes_of(const PrintDoubt& doubt, const PrintMatrix& squares_px2_per_mm2,
                      const std::array<double, 4>& weights, const Marker& marker);

}  // namespace lapservo::internal
