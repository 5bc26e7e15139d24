#pragma once

#include "lapservo/geometry/camera.h"

namespace lapservo::internal {

/// Angle between the optical axis and the ray through the image's farthest corner, or through the farthest pixel
/// towards it that the distortion does not fold. A lens's distortion is known, and can be inverted, up to there.
double half_field_rad(const Camera& camera);

/// Whether every pixel of the largest circle amid the image has a ray. Endoscopes show hardly more than a circle,
/// outside of which their distortion was not measured and may fold.
bool is_invertible(const Camera& camera);

/// Whether every pixel of the image has a ray.
bool is_invertible_everywhere(const Camera& camera);

}  // namespace lapservo::internal
