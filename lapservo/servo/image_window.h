#pragma once

#include "lapservo/control/controller_config.h"
#include "lapservo/geometry/camera.h"

namespace lapservo {

/// The camera's image less a margin, in ideal pixels: the largest upright rectangle of which every point lies in the
/// (distorted) image, and none where the distortion folds. Throws InputError when the margin leaves nothing.
ImageWindow image_window(const Camera& camera, double margin_px);

}  // namespace lapservo
