#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// tau from a cross-ratio (eq. 18). For the linear family (l1 : l2 constant) the map is linear and exact; for every
/// other design r - 1 = l1 l3 / (l2 L) is a ratio of polynomials in tau, inverted in closed form.
class CrossRatioDecoder {
 public:
  /// Throws std::invalid_argument with decoding_problem's text when the cross-ratio is not monotonic in tau.
  explicit CrossRatioDecoder(const Marker& marker);

  /// tau in [0, covered_rad()]; a cross-ratio beyond the marker's range gives the nearer end, a non-finite one gives
  /// NaN.
  double tau_rad(double cross_ratio) const;

  double lowest_cross_ratio() const { return lowest_; }
  double highest_cross_ratio() const { return highest_; }

 private:
  Marker marker_;
  double at_upper_, at_lower_, lowest_, highest_;
};

/// Empty when the cross-ratio runs strictly monotonically over tau; else why and where it does not.
std::string decoding_problem(const Marker& marker);

/// Returns the marker; throws InputError naming `source` for what is none (marker_problem) or can't be decoded.
const Marker& decodable(const Marker& marker, std::string_view source);

/// tau in [0, covered_rad()] from the length of band 0, 1 or 2 along the shaft (eq. 16). The length must be known in
/// metres, and an image shows lengths only as well as depth and inclination are known: trackers read the cross-ratio
/// (CrossRatioDecoder), which needs neither. A length beyond the band's range gives the nearer end, a non-finite one
/// gives NaN. Throws std::invalid_argument where the band is as long at every rotation.
double tau_by_length_rad(const Marker& marker, std::size_t band, double length_m);

}  // namespace lapservo::internal
