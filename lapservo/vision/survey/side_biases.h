#pragma once

#include <array>
#include <optional>
#include <span>

#include "lapservo/vision/camera/picture_processing.h"
#include "lapservo/vision/edges/edge_measurements.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

/// By how much locate_contours mislocates either side, inwards, for what `processing` makes of its light: colour
/// differences that are blurred lie off where one side of the edge is dark. `blur` is what the measurements were
/// located with, `radius_px` the shaft's. Nullopt for a side that was seen on few lines.
std::array<std::optional<double>, 2> side_biases_px(const LightImage& light, std::span<const Measurement> measurements,
                                                    const PictureProcessing& processing, const EdgeBlur& blur,
                                                    double radius_px);

}  // namespace lapservo::internal
