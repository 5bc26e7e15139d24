#include "lapservo/marker/sensitivity.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"

namespace lapservo {
using namespace internal;
namespace {

// d(ln r)/d(e0..e3) of r = (e2 - e0)(e3 - e1) / ((e2 - e1)(e3 - e0)).
std::array<double, 4> log_gradient(const std::array<double, 4>& e) {
  const double whole = 1 / (e[3] - e[0]), first_two = 1 / (e[2] - e[0]), last_two = 1 / (e[3] - e[1]),
               middle = 1 / (e[2] - e[1]);
  return {whole - first_two, middle - last_two, first_two - middle, last_two - whole};
}

}  // namespace

double cross_ratio_slope(const Marker& marker, double tau_rad) {
  const auto e = boundaries_m(marker, tau_rad);
  const auto gradient = log_gradient(e);
  const auto slopes = boundary_slopes_m(marker);
  double slope = 0;
  for (std::size_t k = 0; k < 4; ++k) slope += gradient[k] * slopes[k];
  return slope * cross_ratio_at(marker, tau_rad);
}

std::array<double, 4> tau_by_boundaries(const Marker& marker, double tau_rad) {
  auto by_boundaries = log_gradient(boundaries_m(marker, tau_rad));
  // A boundary farther distal raises the cross-ratio as a larger tau would.
  const double per_rad = cross_ratio_slope(marker, tau_rad) / cross_ratio_at(marker, tau_rad);
  for (double& value : by_boundaries) value /= per_rad;
  return by_boundaries;
}

double predicted_print_error_rad(const Marker& marker, double tau_rad, double print_error_m) {
  const double fraction = wrap_two_pi(tau_rad) / marker.covered_rad();
  const auto by_boundaries = tau_by_boundaries(marker, tau_rad);
  double square = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    const bool inner = k == 1 || k == 2;
    const double weight = inner ? (1 - fraction) * (1 - fraction) + fraction * fraction : 1;
    square += weight * by_boundaries[k] * by_boundaries[k];
  }
  return print_error_m * std::sqrt(square);
}

double predicted_sigma_centre_line_rad(const Marker& marker, double tau_rad, const Viewing& viewing) {
  double square = 0;
  for (const double partial : log_gradient(boundaries_m(marker, tau_rad))) square += partial * partial;
  const double sigma_m = viewing.sigma_edge_px / viewing.px_per_m();
  return sigma_m * std::sqrt(square) * cross_ratio_at(marker, tau_rad) / std::abs(cross_ratio_slope(marker, tau_rad));
}

double predicted_sigma_surface_rad(const Marker& marker, double tau_rad, const Viewing& viewing) {
  constexpr double reach = 0.9, seam_room_px = 2.5;
  const double radius_px = marker.radius_m() * viewing.px_per_m();
  const int lines = std::max(3, static_cast<int>(2 * reach * radius_px));
  const auto slopes = boundary_slopes_m(marker);
  double tau_tau = 0, tau_rho = 0, rho_rho = 0;
  for (int i = 0; i < lines; ++i) {
    const double sine = reach * (2 * (i + 0.5) / lines - 1);
    const double seam_rad = distance_to_seam_rad(marker, tau_rad + std::asin(sine));
    const double seam_px = seam_rad * radius_px * std::sqrt(1 - sine * sine);
    for (std::size_t k = 0; k < 4; ++k) {
      if (jumps_at_seam(marker, k) && seam_px < seam_room_px) continue;
      tau_tau += slopes[k] * slopes[k];
      tau_rho += slopes[k];
      rho_rho += 1;
    }
  }
  const double sigma_m = viewing.sigma_edge_px / viewing.px_per_m();
  return sigma_m / std::sqrt(std::max(0.0, tau_tau - tau_rho * tau_rho / std::max(1.0, rho_rho)));
}

}  // namespace lapservo
