#pragma once

#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/scene.h"

namespace lapservo::internal {

/// When an inner boundary shows elsewhere than a fit has it. Of 1186 exact prints under 40 %
/// of blood none has a line that says so beyond those that agree; of 771 inks aside that were wrong by 0.1 rad and ok
/// but for the rule about inner boundaries it tells 663.
struct DisplacedLimits {
  double located = 0.7;                                           ///< of the lines: on as many a fit has what shows
  double agreeing_px = 0.5, agreeing_sigmas = 4, tolerances = 3;  ///< at most so far from the fit, it agrees
  double max_sigma_px = 0.5, alike_px = 0.4;                      ///< of points that may show it elsewhere
  int least_lines = 3;
  /// However many agree: exact prints have one such line at most, two of 1200 prints with bands off that were 0.2 rad
  /// wrong, over the seam, have six.
  double clear_sigma_px = 0.12;
  int least_clear_lines = 4;
};
inline constexpr DisplacedLimits displaced_limits;

/// Whether it is worth while: an inner boundary is not located on many lines.
bool may_be_displaced(const FineFit& fit);

/// Whether such a boundary shows beside where the fit has it, farther away than a fit's last passes look, on more lines
/// than agree with the fit, or very clearly: what was taken for it is an edge of blood, and the print not the rig's.
/// Looks at the edges once more.
bool is_displaced(const Scene& scene, const LightImage& light, const FineFit& fit);

}  // namespace lapservo::internal
