#pragma once

#include <array>

#include "lapservo/marker/marker.h"

namespace lapservo {

/// How a camera sees a marker head on.
struct Viewing {
  double focal_px = 1100;
  double distance_m = 0.11;
  double sigma_edge_px = 0.1;  ///< standard deviation of one boundary on one line
  double px_per_m() const { return focal_px / distance_m; }
};

/// d(cross-ratio)/d(tau), per radian.
double cross_ratio_slope(const Marker& marker, double tau_rad);

/// d(tau)/d(place of e0..e3), radians per metre: by how much tau is mistaken on the centre line when a boundary lies
/// farther distal than the rig says, to first order.
std::array<double, 4> tau_by_boundaries(const Marker& marker, double tau_rad);

/// Standard deviation of tau on the centre line when the print is off: both ends, and each inner boundary at either
/// edge of the print, by independent errors of this standard deviation.
double predicted_print_error_rad(const Marker& marker, double tau_rad, double print_error_m);

/// Standard deviation of tau from the centre line alone: four boundaries, their cross-ratio, eq. (18), to first order.
/// In the gap, where there are none, that of a print that went on.
double predicted_sigma_centre_line_rad(const Marker& marker, double tau_rad, const Viewing& viewing);

/// Standard deviation of tau from all visible generatrices (a line per pixel over +-64 degrees) when the axis is known
/// and the place along it is estimated too: the Cramer-Rao bound. Within 2.5 px of the print's edges, boundaries that
/// jump there do not count, and none does in the gap; infinite where too few are left.
double predicted_sigma_surface_rad(const Marker& marker, double tau_rad, const Viewing& viewing);

}  // namespace lapservo
