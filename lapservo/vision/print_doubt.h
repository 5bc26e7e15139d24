#pragma once

#include <array>

#include "lapservo/core/inplace_vector.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/print_errors.h"

namespace lapservo::internal {

/// How a picture that is blurred, compressed or processed moves boundaries as a print's errors would, one sigma each:
/// every boundary as a whole, the inner ones about their middle (rms over what shows), and all as if the marker were
/// longer by this fraction.
struct PrintDoubt {
  double boundary_px = 0, tilt_px = 0, length_fraction = 0;
};

/// Errors of the print [mm] by one sigma of what is doubted, independent of each other.
using PrintShapes = InplaceVector<PrintVector, 7>;

/// `squares_px2_per_mm2`: the weighted squares of d(residual)/d(print's errors) summed over all measurements, `weights`
/// the sum of each boundary's weights: of a boundary without any, nothing is doubted.
PrintShapes shapes_of(const PrintDoubt& doubt, const PrintMatrix& squares_px2_per_mm2,
                      const std::array<double, 4>& weights, const Marker& marker);

}  // namespace lapservo::internal
