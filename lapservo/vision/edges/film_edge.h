#pragma once

#include <cstddef>
#include <span>

#include <Eigen/Core>

#include "lapservo/core/inplace_vector.h"

namespace lapservo::internal {

/// The light on the film's edge and beside it.
struct FilmEdgeLimits {
  /// Light on the film's edge, by that on the outside at most: the even fraction (the rest is diffuse, from the
  /// camera), what is usual and one sigma of it; one sigma of what a boundary shows of it (lamps fade with the
  /// distance, and no paper is quite matt), from so many points on.
  double most_lit = 3, usual_even_light = 0.1, even_light_sigma = 0.07, most_even_light = 0.4;
  double told_even_light_sigma = 0.03;
  std::size_t min_fading_points = 8;
  /// Diffuse light of the darkest channel on either side of an end, by the largest change of a channel there: black
  /// plastic and a print's dark channels reflect 2 to 5 %, its bright ones half. And the specular light that counts.
  double darkest_light = 0.04, most_gloss = 0.6;
};
inline constexpr FilmEdgeLimits film_edge_limits;

/// The cut edge of the film that carries the marker, between the bare shaft and the outside of the print: where an end
/// is seen from beyond it shows, as a strip of its own brightness. The end is located nearer to the axis than the
/// outside: by the film's thickness where the strip is as bright, by less or more as it is darker or brighter.

/// How much the outside and, at an end, the film's edge face the camera (cosines); 0 of an edge that is not seen.
struct Facing {
  double outside = 1, film_edge = 0;
};

/// A point of an inner boundary: the change of light there, in any unit.
struct FadingPoint {
  double outside_facing, step;
};

/// The even part of the light on the shaft, from how the change of light over an inner boundary fades towards the
/// sides, and 1/sigma^2 (0: too few points). Both sides of it have the same specular light, which does not count.
struct EvenLight {
  double fraction = 0, certainty = 0;
};
EvenLight even_light_of(std::span<const FadingPoint> points);
/// For those of several boundaries, with what is usual.
double usual_or_seen(std::span<const EvenLight> seen);

/// The diffuse light on the film's edge by that on the outside beside it.
double film_edge_light(const Facing& facing, double even_light);

/// The light beside a point of an end, per channel: of the bare shaft and of the outside.
using EndPoint = Eigen::Matrix<float, 3, 2>;
inline constexpr std::size_t max_end_points = 64;

/// Levels of the film's edge at an end, by its light: 0 is the bare shaft, 1 the outside. In units of the step from the
/// shaft up to the outside. Both sides have specular light, that of the darkest channel of either side; its part that
/// all of the end has veils the image. The film's edge faces elsewhere and has no specular light.
class EndLight {
 public:
  explicit EndLight(std::span<const EndPoint> points);
  /// In the channels of the step: without specular light, and what point i's specular light takes off.
  double matt_level(double light) const { return light - (1 - light) * step_.dot(shaft_); }
  double gloss_level(std::size_t point) const { return step_.sum() * gloss_[point]; }
  /// In one channel, at point i; as in all where it does not show the end.
  double level(double light, std::size_t point, std::size_t channel) const;

 private:
  Eigen::Vector3d step_, shaft_;                 // a unit vector, and the shaft's diffuse light by the step
  InplaceVector<double, max_end_points> gloss_;  // specular light by the step there
};
/// Before it is seen: of a black shaft, without specular light.
double usual_film_edge_level(const Facing& facing);

/// By what fraction of the film's projected width an end is moved inwards whose film's edge has this level (of wide
/// ones, in blurs, by less than that), and d(shift)/d(width).
struct FilmShift {
  double fraction, by_width;
};
FilmShift film_shift(double level, double width_blurs);

}  // namespace lapservo::internal
