#pragma once

#include <array>
#include <string>
#include <vector>

#include "lapservo/calibration/marker_calibration.h"
#include "lapservo/experiments/svg_plot.h"

namespace lapservo::app {

/// Where boundaries were found beyond a print, over tau: means over `parts` parts of the turn (thousands of points, a
/// page that opens), 0 being `reference`. `names` of e0 to e3.
internal::Plot print_residual_plot(const std::string& title, const std::vector<internal::PrintResidual>& residuals,
                                   const std::array<std::string, 4>& names, const std::string& reference, int parts);

}  // namespace lapservo::app
