#pragma once

#include <array>
#include <string>

namespace lapservo {

/// A printed three-colour marker, wrapped around a shaft (docs/conventions.md, "Marker"). The bands run from proximal
/// to distal; tau in [0, 2 pi) is the azimuth on the marker from its seam, right-handed about the axis towards the tip.
struct Marker {
  double diameter_m = 0;  ///< outer, film included
  std::array<double, 3> hues_deg{90, 180, 270};
  std::array<double, 3> bands_upper_m{};  ///< lengths at tau = 0
  std::array<double, 3> bands_lower_m{};  ///< lengths at tau -> 2 pi
  double seam_rad = 0;                    ///< instrument azimuth of the seam
  double tolerance_m = 0;  ///< standard deviation of where each boundary lies at either edge of the print

  double radius_m() const { return diameter_m / 2; }
  double length_m() const { return bands_upper_m[0] + bands_upper_m[1] + bands_upper_m[2]; }
};

/// Positions of e0..e3 along the axis from the proximal end, metres, at an azimuth (any angle; wrapped here).
std::array<double, 4> boundaries_m(const Marker& marker, double tau_rad);

/// Derivative of boundaries_m by tau, metres per radian: constant but for the jump at the seam.
std::array<double, 4> boundary_slopes_m(const Marker& marker);

/// Cross-ratio r(l1, l2, l3) = (l1 + l2)(l2 + l3) / (l2 (l1 + l2 + l3)) of collinear points (eq. 17). It is the same
/// in every perspective image of them.
double cross_ratio(double l1, double l2, double l3);

/// Cross-ratio of the marker's boundaries at an azimuth, from which eq. (18) tells it.
double cross_ratio_at(const Marker& marker, double tau_rad);

/// Empty when lengths, hues and sums make a marker; else "field: is value, expected ..." for the first that doesn't.
/// Does not ask whether the cross-ratio can be decoded: see CrossRatioDecoder.
std::string marker_problem(const Marker& marker);

/// Two markers whose bands have the same hues in the same places can't be told apart by colour.
bool same_colour_order(const Marker& a, const Marker& b);

/// Nor can two whose orders are reversals of one another: each looks like the other turned end for end.
bool reversed_colour_order(const Marker& a, const Marker& b);

}  // namespace lapservo
