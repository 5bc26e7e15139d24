#include "lapservo/vision/edges/blurred_edges.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lapservo::internal {
namespace {

BlurredEdge integrate(double u) {
  const auto density = [](double t) { return std::exp(-t * t / 2) / std::sqrt(2 * std::numbers::pi); };
  // Substituting t = s^2 takes the square root's kink at the edge out of the integral.
  constexpr int steps = 400;
  const double longest = std::sqrt(std::max(0.0, u) + 8);
  double root = 0, three_halves = 0, root_slope = 0;
  for (int i = 0; i < steps; ++i) {
    const double s = longest * (i + 0.5) / steps;
    const double weight = density(u - s * s) * 2 * s * longest / steps;
    root += weight * s;
    three_halves += weight * s * s * s;
    root_slope += weight * 0.5 / s;
  }
  return {static_cast<float>(density(u)), static_cast<float>(0.5 * std::erfc(-u / std::numbers::sqrt2)),
          static_cast<float>(root), static_cast<float>(three_halves), static_cast<float>(root_slope)};
}

}  // namespace

BlurredEdges::BlurredEdges() {
  for (std::size_t i = 0; i < entries.size(); ++i) entries[i] = integrate(first_u + static_cast<double>(i) / per_sigma);
}

const BlurredEdges& BlurredEdges::instance() {
  static const BlurredEdges table;
  return table;
}

}  // namespace lapservo::internal
