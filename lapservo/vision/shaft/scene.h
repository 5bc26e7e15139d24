#pragma once

#include <algorithm>
#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "lapservo/core/angles.h"
#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/colour/colour_classes.h"
#include "lapservo/vision/image/lens_field.h"
#include "lapservo/vision/image/light_image.h"
#include "lapservo/vision/observation.h"
#include "lapservo/vision/shaft/rcm_prior.h"
#include "lapservo/vision/shaft/rolling_shutter.h"
#include "lapservo/vision/shaft/shaft_cover.h"

namespace lapservo::internal {

/// Sides from which a print is seen: 15 degrees of tau each.
inline constexpr std::size_t print_sides = 24;
using PrintSides = std::bitset<print_sides>;

/// That of a generatrix which faces the camera; any angle.
inline std::size_t print_side(double tau_rad) {
  const auto side = static_cast<std::size_t>(wrap_two_pi(tau_rad) / two_pi * static_cast<double>(print_sides));
  return std::min(side, print_sides - 1);
}

/// One frame and the one instrument that is looked for in it. Borrows everything.
struct Scene {
  const ImageView& image;
  const Camera& camera;
  const ColourClasses& classes;
  const Marker& marker;
  std::array<std::uint8_t, 3> bands;            ///< colour class of each band
  std::span<const ShaftCover* const> others{};  ///< that were found, near enough to hide it or to touch it
  PrintSides known_sides{};                     ///< from which earlier frames showed that its print is the rig's
  double max_p_false = Observation::usual_max_p_false;  ///< TrackerOptions::max_p_false
  const RcmPrior* registration = nullptr;               ///< of the instrument; nullptr where it is not known
  std::optional<PoseBefore> before{};                   ///< of a rolling shutter: the marker in the frame before
  LensField field{camera};

  /// Where the image says nothing of this instrument: beyond its border, or since another one shows there.
  static constexpr std::uint8_t outside = 255;
  /// The nearest pixel, nullptr beyond the image; and its colour class, `outside` there.
  const std::uint8_t* pixel_at(const Eigen::Vector2d& raw_px) const {
    const double u = raw_px.x() + 0.5, v = raw_px.y() + 0.5;
    const bool is_inside = u >= 0 && v >= 0 && u < image.width_px && v < image.height_px;
    return is_inside ? image.pixel(static_cast<int>(u), static_cast<int>(v)) : nullptr;
  }
  std::uint8_t class_at(const Eigen::Vector2d& raw_px) const {
    const std::uint8_t* const bgr = pixel_at(raw_px);
    return bgr ? classes(bgr) : outside;
  }
  /// The same, and `outside` where another instrument's marker shows.
  std::uint8_t class_beside(const Eigen::Vector2d& raw_px) const {
    const std::uint8_t colour = class_at(raw_px);
    return !others.empty() && explained_by(others, raw_px, colour) ? outside : colour;
  }
  /// Whether another instrument lies before a point in the camera's frame.
  bool hidden(const Eigen::Vector3d& point) const { return !others.empty() && hidden_by(others, point); }
  /// Whether the registration shows on which lines of the image the shaft may lie.
  bool knows_rcm() const { return registration && registration->is_within(marker.radius_m()); }
  /// How its rolling shutter, if it has one, shows the marker at a pose.
  RowMotion motion_at(const PoseUnknowns& pose) const {
    return before ? RowMotion(camera, marker, pose, *before) : RowMotion();
  }
  /// Whether it is the class of one of the marker's bands.
  bool is_ours(std::uint8_t colour) const { return colour == bands[0] || colour == bands[1] || colour == bands[2]; }
};

}  // namespace lapservo::internal
