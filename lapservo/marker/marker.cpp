#include "lapservo/marker/marker.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "lapservo/core/angles.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr double min_diameter_m = 0.5e-3, max_diameter_m = 0.1;
constexpr double max_band_m = 0.5, max_askew_m = 0.02, max_gap_rad = 1.5;
constexpr double min_hue_gap_deg = 40;  // closer hues blend under white balance, blur and smoke

FieldProblem problem(const std::string& field, double value, const std::string& expected) {
  return {field, fmt::format("{:g}", value), expected};
}

}  // namespace

std::optional<double> Marker::measured_sigma_m() const {
  if (!sigmas.bands_upper_m || !sigmas.bands_lower_m) return std::nullopt;
  if (tolerance_m > 0) return tolerance_m;
  // Between what bands leave that were measured each by itself (0.9), and boundaries that were (0.7).
  constexpr double boundary_by_band = 0.8;
  double squares = 0;
  for (const auto& bands_m : {*sigmas.bands_upper_m, *sigmas.bands_lower_m})
    for (const double sigma_m : bands_m) squares += sigma_m * sigma_m / 6;
  return boundary_by_band * std::sqrt(squares);
}

bool Marker::bands_are_measured() const {
  constexpr double largest_sigma_m = 0.03e-3;
  return measured_sigma_m().value_or(1) <= largest_sigma_m;
}

std::array<double, 4> boundaries_m(const Marker& marker, double tau_rad) {
  const double t = wrap_two_pi(tau_rad) / marker.covered_rad(), wrapped_m = t * marker.wrap_m;
  const auto& upper = marker.bands_upper_m;
  const auto& lower = marker.bands_lower_m;
  const double l1 = upper[0] + t * (lower[0] - upper[0]);
  const double l2 = upper[1] + t * (lower[1] - upper[1]);
  return {wrapped_m, wrapped_m + l1, wrapped_m + (l1 + l2), wrapped_m + (marker.length_m() + t * marker.skew_m)};
}

std::array<double, 4> boundary_slopes_m(const Marker& marker) {
  const double covered_rad = marker.covered_rad(), wrap = marker.wrap_m / covered_rad;
  const double d1 = (marker.bands_lower_m[0] - marker.bands_upper_m[0]) / covered_rad;
  const double d2 = (marker.bands_lower_m[1] - marker.bands_upper_m[1]) / covered_rad;
  return {wrap, wrap + d1, wrap + (d1 + d2), wrap + marker.skew_m / covered_rad};
}

double cross_ratio(double l1, double l2, double l3) {
  return (l1 + l2) * (l2 + l3) / (l2 * (l1 + l2 + l3));
}

double cross_ratio_at(const Marker& marker, double tau_rad) {
  const auto e = boundaries_m(marker, tau_rad);
  return cross_ratio(e[1] - e[0], e[2] - e[1], e[3] - e[2]);
}

bool jumps_at_seam(const Marker& marker, std::size_t boundary) {
  if (boundary == 1 || boundary == 2 || marker.gap_rad > 0) return true;
  return boundary == 0 ? marker.wrap_m != 0 : marker.wrap_m + marker.skew_m != 0;
}

double distance_to_seam_rad(const Marker& marker, double tau_rad) {
  const double to_upper_rad = std::abs(wrap_pi(tau_rad));
  if (marker.gap_rad == 0) return to_upper_rad;
  const double tau = wrap_two_pi(tau_rad);
  return tau >= marker.covered_rad() ? 0 : std::min(to_upper_rad, marker.covered_rad() - tau);
}

bool is_printed(const Marker& marker, double tau_rad) {
  return marker.gap_rad == 0 || wrap_two_pi(tau_rad) < marker.covered_rad();
}

std::optional<FieldProblem> marker_problem(const Marker& marker) {
  const auto within = [](double value, double low, double high) { return value >= low && value <= high; };
  if (!within(marker.diameter_m, min_diameter_m, max_diameter_m))
    return problem("diameter_m", marker.diameter_m, "0.0005 to 0.1 (metres)");
  for (std::size_t i = 0; i < 3; ++i) {
    const std::string index = fmt::format("[{}]", i);
    if (!within(marker.hues_deg[i], 0, 360)) return problem("hues_deg" + index, marker.hues_deg[i], "0 to 360");
    if (!(marker.bands_upper_m[i] > 0 && marker.bands_upper_m[i] <= max_band_m))
      return problem("bands_upper_m" + index, marker.bands_upper_m[i], "a length above 0, up to 0.5 (metres)");
    if (!(marker.bands_lower_m[i] > 0 && marker.bands_lower_m[i] <= max_band_m))
      return problem("bands_lower_m" + index, marker.bands_lower_m[i], "a length above 0, up to 0.5 (metres)");
  }
  for (std::size_t i = 0; i < 3; ++i)
    if (hue_gap_deg(marker.hues_deg[i], marker.hues_deg[(i + 1) % 3]) < min_hue_gap_deg)
      return problem("hues_deg[" + std::to_string((i + 1) % 3) + "]", marker.hues_deg[(i + 1) % 3],
                     "hues at least 40 degrees apart");
  const double lower_sum = marker.bands_lower_m[0] + marker.bands_lower_m[1] + marker.bands_lower_m[2];
  if (!within(marker.wrap_m, -max_askew_m, max_askew_m))
    return problem("wrap_m", marker.wrap_m, "-0.02 to 0.02 (metres)");
  if (!within(marker.skew_m, -max_askew_m, max_askew_m))
    return problem("skew_m", marker.skew_m, "-0.02 to 0.02 (metres)");
  if (!within(marker.gap_rad, 0, max_gap_rad)) return problem("gap_rad", marker.gap_rad, "0 to 1.5 (radians)");
  if (!(std::abs(lower_sum - marker.length_m() - marker.skew_m) <= 1e-6))
    return FieldProblem{"bands_lower_m", "a sum of " + std::to_string(lower_sum),
                        marker.skew_m == 0 ? "the same sum as bands_upper_m (" + std::to_string(marker.length_m()) +
                                                 "): both ends of the marker are circles"
                                           : "that of bands_upper_m and skew_m (" +
                                                 std::to_string(marker.length_m() + marker.skew_m) + ")"};
  if (!(std::abs(marker.seam_rad) <= two_pi))
    return problem("seam_rad", marker.seam_rad, "radians, at most a turn: larger numbers look like degrees");
  return std::nullopt;
}

bool same_colour_order(const Marker& a, const Marker& b) {
  const auto alike = [&](std::size_t band) {
    return hue_gap_deg(a.hues_deg[band], b.hues_deg[band]) < min_hue_gap_deg / 2;
  };
  return alike(1) && (alike(0) || alike(2));
}

bool reversed_colour_order(const Marker& a, const Marker& b) {
  Marker turned = b;
  std::reverse(turned.hues_deg.begin(), turned.hues_deg.end());
  return same_colour_order(a, turned);
}

}  // namespace lapservo
