#include "lapservo/marker/decoder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <fmt/format.h>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {

// With t the fraction of the print: l_i = upper_i + t slope_i, L = total + t total_slope, and r - 1 = l1 l3 / (l2 L). A
// shift of all boundaries alike, as by an oblique wrap, leaves it unchanged.
struct Lengths {
  std::array<double, 3> upper, slope;
  double total, total_slope;
};

Lengths lengths(const Marker& marker) {
  Lengths l{marker.bands_upper_m, {}, marker.length_m(), marker.skew_m};
  for (std::size_t i = 0; i < 3; ++i) l.slope[i] = marker.bands_lower_m[i] - marker.bands_upper_m[i];
  return l;
}

// Numerator of dr/dt over the length at the upper edge, a quadratic c0 + c1 t + c2 t^2: (n' d - n d') / total with
// n = l1 l3 and d = l2 L. The cubic terms cancel.
std::array<double, 3> derivative_numerator(const Lengths& l) {
  const auto [a1, a2, a3] = l.upper;
  const auto [b1, b2, b3] = l.slope;
  const double n0 = a1 * a3, n1 = a1 * b3 + b1 * a3, n2 = b1 * b3;
  const double growth = l.total_slope / l.total;
  const double d0 = a2, d1 = b2 + growth * a2, d2 = growth * b2;
  return {n1 * d0 - n0 * d1, 2 * (n2 * d0 - n0 * d2), n2 * d1 - n1 * d2};
}

double lowest_of_quadratic_on_unit_interval(const std::array<double, 3>& c, double sign) {
  const auto value = [&](double t) { return sign * (c[0] + t * (c[1] + t * c[2])); };
  double lowest = std::min(value(0), value(1));
  if (c[2] != 0) {
    const double turning = -c[1] / (2 * c[2]);
    if (turning > 0 && turning < 1) lowest = std::min(lowest, value(turning));
  }
  return lowest;
}

}  // namespace

std::string decoding_problem(const Marker& marker) {
  const Lengths l = lengths(marker);
  const auto c = derivative_numerator(l);
  const double begin = cross_ratio(l.upper[0], l.upper[1], l.upper[2]);
  const double end = cross_ratio(l.upper[0] + l.slope[0], l.upper[1] + l.slope[1], l.upper[2] + l.slope[2]);
  const double sign = end > begin ? 1 : -1;
  // Relative to the size of the terms: a slope that vanishes in rounding is no slope.
  const double scale = std::abs(c[0]) + std::abs(c[1]) + std::abs(c[2]);
  const double length_cubed = l.total * l.total * l.total;
  if (scale > 1e-6 * length_cubed && lowest_of_quadratic_on_unit_interval(c, sign) > 1e-6 * scale) return {};
  if (scale <= 1e-6 * length_cubed)
    return "the cross-ratio is the same at every rotation: the inner boundaries must slope";
  const auto slope = [&](double t) { return c[0] + t * (c[1] + t * c[2]); };
  double turns_at = 0;  // l1 l3 / l2 of positive lengths whose sum is constant has no minimum: it rises, then falls
  while (turns_at < 1 && slope(turns_at) > 0) turns_at += 1.0 / 360;
  return fmt::format("the cross-ratio turns back near tau = {:.2f} rad, so that two rotations look the same",
                     marker.covered_rad() * turns_at);
}

const Marker& decodable(const Marker& marker, std::string_view source) {
  if (const auto problem = marker_problem(marker)) throw InputError(source, *problem);
  if (const std::string problem = decoding_problem(marker); !problem.empty())
    throw InputError(source, "not decodable: " + problem);
  return marker;
}

CrossRatioDecoder::CrossRatioDecoder(const Marker& marker) : marker_(marker) {
  const std::string problem = decoding_problem(marker);
  if (!problem.empty()) throw std::invalid_argument(problem);
  const auto& u = marker.bands_upper_m;
  const auto& w = marker.bands_lower_m;
  at_upper_ = cross_ratio(u[0], u[1], u[2]);
  at_lower_ = cross_ratio(w[0], w[1], w[2]);
  lowest_ = std::min(at_upper_, at_lower_);
  highest_ = std::max(at_upper_, at_lower_);
}

double CrossRatioDecoder::tau_rad(double cross_ratio) const {
  if (!std::isfinite(cross_ratio)) return std::numeric_limits<double>::quiet_NaN();
  const bool towards_upper = (cross_ratio <= lowest_) == (at_upper_ <= at_lower_);
  const double covered_rad = marker_.covered_rad();
  if (cross_ratio <= lowest_ || cross_ratio >= highest_) return towards_upper ? 0 : covered_rad;
  // l1 l3 - (r - 1) l2 L = 0 is q0 + q1 t + q2 t^2. Monotonicity leaves one root in [0, 1].
  const Lengths l = lengths(marker_);
  const double scaled = (cross_ratio - 1) * l.total, growth = (cross_ratio - 1) * l.total_slope;
  const double q0 = l.upper[0] * l.upper[2] - scaled * l.upper[1];
  const double q1 = l.upper[0] * l.slope[2] + l.slope[0] * l.upper[2] - scaled * l.slope[1] - growth * l.upper[1];
  const double q2 = l.slope[0] * l.slope[2] - growth * l.slope[1];
  const double root = std::sqrt(std::max(0.0, q1 * q1 - 4 * q0 * q2));
  const double stable = -0.5 * (q1 + std::copysign(root, q1));
  const double t_a = q2 != 0 ? stable / q2 : std::numeric_limits<double>::infinity();
  const double t_b = stable != 0 ? q0 / stable : 0;
  const auto distance = [](double t) { return std::max({0.0, -t, t - 1}); };
  const double t = distance(t_b) <= distance(t_a) ? t_b : t_a;
  return covered_rad * std::clamp(t, 0.0, 1.0);
}

double tau_by_length_rad(const Marker& marker, std::size_t band, double length_m) {
  constexpr double min_change = 1e-6;  // of the marker's length: less is rounding
  const double upper_m = marker.bands_upper_m.at(band), change_m = marker.bands_lower_m.at(band) - upper_m;
  if (!(std::abs(change_m) > min_change * marker.length_m()))
    throw std::invalid_argument("band " + std::to_string(band) +
                                " is as long at every rotation: one of its boundaries must slope");
  if (!std::isfinite(length_m)) return std::numeric_limits<double>::quiet_NaN();
  return marker.covered_rad() * std::clamp((length_m - upper_m) / change_m, 0.0, 1.0);
}

}  // namespace lapservo::internal
