#pragma once

#include <array>
#include <cstddef>
#include <numbers>
#include <optional>
#include <string>

#include "lapservo/core/error.h"

namespace lapservo {

/// One standard deviation of each number of a marker that was measured.
struct MarkerSigmas {
  std::optional<double> diameter_m;
  std::optional<std::array<double, 3>> hues_deg, bands_upper_m, bands_lower_m;
  std::optional<double> seam_rad, wrap_m, skew_m, gap_rad, tolerance_m;
  bool operator==(const MarkerSigmas&) const = default;
};

/// A printed three-colour marker, wrapped around a shaft (docs/frames.md, "Marker"). The bands run from proximal
/// to distal; tau in [0, 2 pi) is the azimuth on the marker from its seam, right-handed about the axis towards the tip.
/// The print covers tau from 0 to covered_rad(); what is left is the shaft, bare.
struct Marker {
  double diameter_m = 0;  ///< outer, film included
  std::array<double, 3> hues_deg{90, 180, 270};
  std::array<double, 3> bands_upper_m{};  ///< lengths at tau = 0
  std::array<double, 3> bands_lower_m{};  ///< lengths at the print's other end
  double seam_rad = 0;                    ///< instrument azimuth of the seam
  double tolerance_m = 0;  ///< standard deviation of where each boundary lies at either edge of the print
  double wrap_m = 0;       ///< how much farther distal the print lies at its other end than at tau = 0
  double skew_m = 0;       ///< how much longer it is there: bands_lower_m add up to so much more than bands_upper_m
  double gap_rad = 0;      ///< what the print leaves bare
  MarkerSigmas sigmas{};

  bool operator==(const Marker&) const = default;
  double radius_m() const { return diameter_m / 2; }
  double covered_rad() const { return 2 * std::numbers::pi - gap_rad; }
  /// Standard deviation of where each boundary lies at either edge of a print whose bands all were measured; nullopt of
  /// others.
  std::optional<double> measured_sigma_m() const;
  /// The same, as far as the rig says.
  double boundary_sigma_m() const { return measured_sigma_m().value_or(tolerance_m); }
  /// Whether it was measured to within 0.03 mm, which is about 15 mrad of psi.
  bool bands_are_measured() const;
  double length_m() const { return bands_upper_m[0] + bands_upper_m[1] + bands_upper_m[2]; }
};

/// Positions of e0..e3 along the axis from the proximal end at tau = 0, metres, at an azimuth (any angle; wrapped
/// here). In the gap, where there are none, those of a print that went on.
std::array<double, 4> boundaries_m(const Marker& marker, double tau_rad);

/// Derivative of boundaries_m by tau, metres per radian: constant but for the jump at the seam.
std::array<double, 4> boundary_slopes_m(const Marker& marker);

/// Cross-ratio r(l1, l2, l3) = (l1 + l2)(l2 + l3) / (l2 (l1 + l2 + l3)) of collinear points (eq. 17). It is the same
/// in every perspective image of them.
double cross_ratio(double l1, double l2, double l3);

/// Cross-ratio of the marker's boundaries at an azimuth, which eq. (18) inverts.
double cross_ratio_at(const Marker& marker, double tau_rad);

/// Whether boundary 0..3 comes back at another place: at the seam it jumps.
bool jumps_at_seam(const Marker& marker, std::size_t boundary);

/// From an azimuth (any angle) to the nearer edge of the print; 0 where there is none.
double distance_to_seam_rad(const Marker& marker, double tau_rad);

/// Whether the print is there at all.
bool is_printed(const Marker& marker, double tau_rad);

/// nullopt when lengths, hues and sums make a marker; else what is wrong with the first field that doesn't. Does not
/// ask whether the cross-ratio can be decoded: see CrossRatioDecoder.
std::optional<FieldProblem> marker_problem(const Marker& marker);

/// Two markers whose middle bands and one band more have the same hues in the same places can't be distinguished by
/// colour: blood may hide the third.
bool same_colour_order(const Marker& a, const Marker& b);

/// Nor can two of which one is so when it is reversed: each looks like the other turned end for end.
bool reversed_colour_order(const Marker& a, const Marker& b);

}  // namespace lapservo
