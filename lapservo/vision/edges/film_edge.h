#pragma once

#include <cstddef>
#include <span>

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
  /// Light of the bare shaft by the step of light at an end, without specular light and veils: black plastic reflects 2
  /// to 5 %, a print's bright channels half. And the specular light there that counts.
  double bare_shaft_light = 0.04, most_gloss = 0.6;
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

/// The film's edge by its light, not counting specular light: 0 is the bare shaft, 1 the outside beside it.
double film_edge_level(const Facing& facing, double even_light);

/// The values at a point of an end, along the end's own change of light: bare shaft, and the step up to the outside.
struct EndPoint {
  float shaft, step;
};
inline constexpr std::size_t max_end_points = 64;
/// Specular light on the bare shaft beside each point, by the step there: what the shaft, which is black, has more of
/// than most of the end, as what all of it has veils the image. It is the outside's, too, but not that of the film's
/// edge, which faces elsewhere and lies lower by as much.
InplaceVector<double, max_end_points> gloss_of(std::span<const EndPoint> points);

/// By what fraction of the film's projected width an end is moved inwards whose film's edge has this level (of wide
/// ones, in blurs, by less than that), and d(shift)/d(width).
struct FilmShift {
  double fraction, by_width;
};
FilmShift film_shift(double level, double width_blurs);

}  // namespace lapservo::internal
