#pragma once

#include "lapservo/geometry/camera.h"

namespace lapservo::internal {

/// Whether every pixel has a ray: distortion that was measured in the middle only may fold at the image's border.
bool is_invertible(const Camera& camera);

}  // namespace lapservo::internal
