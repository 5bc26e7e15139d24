#pragma once

#include <array>

#include <Eigen/Core>

#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// The measurable shape of a print: the places of the four boundaries at its upper edge (tau = 0) and at its lower one,
/// from the proximal end at tau = 0, and the gap between the edges.
struct PrintShape {
  std::array<double, 4> upper_m{}, lower_m{};  ///< upper_m[0] is 0
  double gap_rad = 0;

  static PrintShape of(const Marker& marker);
  /// The marker with this print.
  Marker on(Marker marker) const;
};

/// The print's free numbers, in this order: e1, e2, e3 at the upper edge, e0, e1, e2, e3 at the lower edge [m], the gap
/// [rad].
inline constexpr int print_numbers = 8;
using PrintNumbers = Eigen::Matrix<double, print_numbers, 1>;
using PrintCovariance = Eigen::Matrix<double, print_numbers, print_numbers>;

PrintShape changed_by(const PrintShape& shape, const PrintNumbers& change);

/// Standard deviations of the marker's entries that on() writes.
MarkerSigmas sigmas_of(const PrintCovariance& covariance, MarkerSigmas others);

/// The tolerance_m of a rig for this print: the standard deviation of every boundary, at either edge independently,
/// that leaves tau on the centre line as uncertain as the covariance does, over the roll.
double tolerance_of(const PrintShape& shape, const PrintCovariance& covariance, const Marker& marker);

}  // namespace lapservo::internal
