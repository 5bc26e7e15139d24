#pragma once

#include <array>
#include <cstdint>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/color_classes.h"
#include "lapservo/vision/image_view.h"

namespace lapservo {

/// One frame and the one instrument that is looked for in it. Borrows everything.
struct Scene {
  const ImageView& image;
  const Camera& camera;
  const ColorClasses& classes;
  const Marker& marker;
  std::array<std::uint8_t, 3> bands;  ///< colour class of each band

  static constexpr std::uint8_t outside = 255;
  /// Colour class of the nearest pixel, `outside` beyond the image.
  std::uint8_t class_at(const Eigen::Vector2d& raw_px) const {
    const double u = raw_px.x() + 0.5, v = raw_px.y() + 0.5;
    if (!(u >= 0 && v >= 0 && u < image.width_px && v < image.height_px)) return outside;
    return classes(image.pixel(static_cast<int>(u), static_cast<int>(v)));
  }
};

}  // namespace lapservo
