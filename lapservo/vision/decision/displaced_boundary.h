#pragma once

#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/model/fine_fit.h"
#include "lapservo/vision/shaft/scene.h"

namespace lapservo::internal {

/// When an inner boundary shows elsewhere than a fit has it.
struct DisplacedLimits {
  double agreeing_px = 0.5, agreeing_sigmas = 4;  ///< at most so far from the fit, a point agrees with it
  double max_sigma_px = 0.5, alike_px = 0.4;      ///< of points that show it elsewhere, together
  int min_lines = 3;                              ///< that show it there
};
inline constexpr DisplacedLimits displaced_limits;

/// Whether it is worth while: an inner boundary is not located on many lines.
bool may_be_displaced(const FineFit& fit);

/// Whether such a boundary shows beside where the fit has it, farther away than a fit's last passes look, on more lines
/// than agree with the fit: what was taken for it is an edge of blood, and the print not the rig's. Looks at the edges
/// once more.
bool is_displaced(const Scene& scene, const LightImage& light, const FineFit& fit);

}  // namespace lapservo::internal
