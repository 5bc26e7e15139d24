#include "lapservo/vision/blurred_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace lapservo {
namespace {

constexpr float first_u = -6, last_u = 8;
constexpr int per_sigma = 64;
constexpr std::size_t entries = static_cast<std::size_t>((last_u - first_u) * per_sigma) + 2;

BlurredEdge integrate(double u) {
  const auto density = [](double t) { return std::exp(-t * t / 2) / std::sqrt(2 * std::numbers::pi); };
  // Substituting t = s^2 takes the square root's kink at the edge out of the integral.
  constexpr int steps = 400;
  const double longest = std::sqrt(std::max(0.0, u) + 8);
  double root = 0, three_halves = 0;
  for (int i = 0; i < steps; ++i) {
    const double s = longest * (i + 0.5) / steps;
    const double weight = density(u - s * s) * 2 * s * longest / steps;
    root += weight * s;
    three_halves += weight * s * s * s;
  }
  return {static_cast<float>(density(u)), static_cast<float>(0.5 * std::erfc(-u / std::numbers::sqrt2)),
          static_cast<float>(root), static_cast<float>(three_halves)};
}

const std::array<BlurredEdge, entries>& table() {
  static const auto values = [] {
    std::array<BlurredEdge, entries> t{};
    for (std::size_t i = 0; i < entries; ++i) t[i] = integrate(first_u + static_cast<double>(i) / per_sigma);
    return t;
  }();
  return values;
}

}  // namespace

BlurredEdge blurred_edge(float u) {
  if (!(u > first_u)) return {0, 0, 0, 0};
  if (u >= last_u) {  // asymptotic expansions of the moments
    const float root = std::sqrt(u);
    return {0, 1, root * (1 - 1 / (8 * u * u)), root * u * (1 + 3 / (8 * u * u))};
  }
  const float place = (u - first_u) * per_sigma;
  const auto i = static_cast<std::size_t>(place);
  const float f = place - static_cast<float>(i);
  const BlurredEdge &a = table()[i], &b = table()[i + 1];
  return {a.density + f * (b.density - a.density), a.step + f * (b.step - a.step), a.root + f * (b.root - a.root),
          a.three_halves + f * (b.three_halves - a.three_halves)};
}

}  // namespace lapservo
