#include "lapservo/marker/design.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <fmt/format.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/error.h"
#include "lapservo/marker/decoder.h"

namespace lapservo {
using namespace internal;
namespace {

constexpr double rounding_m = 1e-4;

double rounded(double length_m) {
  return std::round(length_m / rounding_m) * rounding_m;
}

// The free numbers of the linear family: fraction of l1 in l1 + l2, and l1 + l2 at the upper and lower edge.
struct Choice {
  double fraction, upper_m, lower_m;
};

Marker marker_of(const DesignSpec& spec, double length_m, const Choice& choice) {
  Marker marker;
  marker.diameter_m = spec.diameter_m;
  marker.hues_deg = spec.hues_deg;
  const auto bands = [&](double sum_m) {
    return std::array<double, 3>{choice.fraction * sum_m, (1 - choice.fraction) * sum_m, length_m - sum_m};
  };
  marker.bands_upper_m = bands(choice.upper_m);
  marker.bands_lower_m = bands(choice.lower_m);
  return marker;
}

double min_band(const Marker& marker) {
  return std::min(std::ranges::min(marker.bands_upper_m), std::ranges::min(marker.bands_lower_m));
}

// Best of a grid around a choice. The sums are rounded here, and not at the end, so that the limits hold after it and
// the ratio l1 : l2, and with it the linear family, survives.
std::optional<Choice> search(const DesignSpec& spec, double length_m, double min_m, const Choice& centre,
                             double fraction_reach, double sum_reach_m) {
  constexpr int steps = 12;
  std::optional<Choice> best;
  double best_sigma = std::numeric_limits<double>::infinity();
  for (int i = -steps; i <= steps; ++i)
    for (int j = -steps; j <= steps; ++j)
      for (int k = -steps; k <= steps; ++k) {
        const Choice choice{centre.fraction + fraction_reach * i / steps,
                            rounded(centre.upper_m + sum_reach_m * j / steps),
                            rounded(centre.lower_m + sum_reach_m * k / steps)};
        if (choice.fraction <= 0 || choice.fraction >= 1 || choice.lower_m - choice.upper_m < rounding_m / 2) continue;
        const Marker marker = marker_of(spec, length_m, choice);
        if (min_band(marker) < min_m - 1e-9) continue;
        const double sigma = worst_sigma_centre_line_rad(marker, spec.viewing, spec.print_error_m);
        if (sigma < best_sigma) best_sigma = sigma, best = choice;
      }
  return best;
}

std::optional<Marker> least_sigma_marker(const DesignSpec& spec, double length_m, double min_m) {
  const double reach_m = (length_m - 3 * min_m) / 2, middle_m = (length_m + min_m) / 2;
  const auto coarse = search(spec, length_m, min_m, {0.5, middle_m, middle_m}, 0.5, reach_m);
  if (!coarse) return std::nullopt;
  const auto fine = search(spec, length_m, min_m, *coarse, 0.08, reach_m / 8);
  return marker_of(spec, length_m, fine.value_or(*coarse));
}

}  // namespace

double worst_sigma_centre_line_rad(const Marker& marker, const Viewing& viewing, double print_error_m) {
  constexpr int steps = 16;
  double worst = 0;
  for (int i = 0; i < steps; ++i) {
    const double tau_rad = marker.covered_rad() * i / (steps - 0.999);
    const double noise_rad = predicted_sigma_centre_line_rad(marker, tau_rad, viewing);
    worst = std::max(worst, print_error_m > 0
                                ? std::hypot(noise_rad, predicted_print_error_rad(marker, tau_rad, print_error_m))
                                : noise_rad);
  }
  return worst;
}

bool in_linear_family(const Marker& marker) {
  const auto &u = marker.bands_upper_m, &l = marker.bands_lower_m;
  return std::abs(u[0] * l[1] - u[1] * l[0]) < 1e-4 * (u[0] + u[1]) * (l[0] + l[1]);
}

Marker design_marker(const DesignSpec& spec) {
  const double length_m = spec.length_m.value_or(std::round(3e3 * spec.diameter_m) * 1e-3);
  const double min_m = spec.min_band_m.value_or(std::max(0.003, 12 / spec.viewing.px_per_m()));
  const auto marker = least_sigma_marker(spec, length_m, min_m);
  if (!marker)
    throw InputError("length", fmt::format("no marker: three bands of at least {:.1f} mm that change over the turn do "
                                           "not fit into {:.1f} mm",
                                           1e3 * min_m, 1e3 * length_m));
  return decodable(*marker, "marker");
}

}  // namespace lapservo
