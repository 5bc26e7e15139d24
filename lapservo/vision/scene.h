#pragma once

#include <array>
#include <cstdint>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/color_classes.h"
#include "lapservo/vision/image_view.h"

namespace lapservo::internal {

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
  /// The same at a point before the camera, [m] in its frame; `outside` when it lies behind.
  std::uint8_t class_at_point(const Eigen::Vector3d& point_in_camera) const {
    return point_in_camera.z() > 1e-3 ? class_at(camera.raw_from_point(point_in_camera)) : outside;
  }
  /// Whether it is the class of one of the marker's bands.
  bool is_ours(std::uint8_t color) const { return color == bands[0] || color == bands[1] || color == bands[2]; }
};

}  // namespace lapservo::internal
