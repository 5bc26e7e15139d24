#pragma once

#include "lapservo/vision/fine_fit.h"
#include "lapservo/vision/light_image.h"
#include "lapservo/vision/scene.h"

namespace lapservo::internal {

/// Whether it is worth while: an inner boundary is not located on many lines.
bool may_be_displaced(const FineFit& fit);

/// Whether such a boundary shows beside where the fit has it, farther away than a fit's last passes look, on more lines
/// than agree with the fit, or very clearly: what was taken for it is an edge of blood, and the print not the rig's.
/// Looks at the edges once more.
bool is_displaced(const Scene& scene, const LightImage& light, const FineFit& fit);

}  // namespace lapservo::internal
