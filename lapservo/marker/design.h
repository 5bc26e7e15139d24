#pragma once

#include <array>
#include <optional>

#include "lapservo/marker/marker.h"
#include "lapservo/marker/sensitivity.h"

namespace lapservo {

struct DesignSpec {
  double diameter_m = 0.0084;
  std::optional<double> length_m;    ///< default: three diameters, to the millimetre
  std::optional<double> min_band_m;  ///< default: 3 mm or 12 px, whichever is more
  std::array<double, 3> hues_deg{90, 180, 270};
  Viewing viewing;
  double print_error_m = 0;  ///< of the print, see predicted_print_error_rad: minimised with the noise
};

/// The marker of the linear family (l1 : l2 constant) with the least worst-case predicted sigma of tau on the centre
/// line, by noise and the print's errors together.
///
/// The family's three free numbers (fraction of l1 in l1 + l2, and l1 + l2 at either edge) are searched on a grid and
/// refined; l1 + l2 comes out in tenths of a millimetre. Throws InputError when no such marker fits.
Marker design_marker(const DesignSpec& spec);

/// The largest predicted_sigma_centre_line_rad over the print, and predicted_print_error_rad with it.
double worst_sigma_centre_line_rad(const Marker& marker, const Viewing& viewing, double print_error_m = 0);

/// Whether l1 : l2 is the same at both edges: then eq. (18) is exact.
bool in_linear_family(const Marker& marker);

}  // namespace lapservo
