#include "lapservo/vision/edges/blurred_edges.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace lapservo::internal::blurred_edges_test {

// The normal density convolved with `edge` at u, by Simpson's rule in s with t = s^2, which smooths the kink at 0.
template <typename Edge>
double convolved(double u, const Edge& edge) {
  constexpr int intervals = 4000;
  const double longest = std::sqrt(std::max(u, 0.0) + 12), step = longest / intervals;
  double sum = 0;
  for (int i = 0; i <= intervals; ++i) {
    const double s = i * step, t = s * s;
    const double weight = i == 0 || i == intervals ? 1 : (i % 2 ? 4 : 2);
    sum += weight * edge(t) * std::exp(-(u - t) * (u - t) / 2) * 2 * s;
  }
  return sum * step / 3 / std::sqrt(2 * std::numbers::pi);
}

constexpr double promised_error = 1e-4;

TEST(BlurredEdges, AreTheConvolutionsWithTheNormalDensity) {
  const BlurredEdges& edges = BlurredEdges::instance();
  for (double u = -7; u < 14; u += 0.0137) {
    const BlurredEdge edge = edges.at(static_cast<float>(u));
    const double root = convolved(u, [](double t) { return std::sqrt(t); });
    const double three_halves = convolved(u, [](double t) { return t * std::sqrt(t); });
    EXPECT_NEAR(edge.density, std::exp(-u * u / 2) / std::sqrt(2 * std::numbers::pi), promised_error) << u;
    EXPECT_NEAR(edge.step, convolved(u, [](double) { return 1.0; }), promised_error) << u;
    if (u > BlurredEdges::last_u) continue;  // density and step of the table's end
    EXPECT_NEAR(edge.root, root, promised_error) << u;
    EXPECT_NEAR(edge.three_halves, three_halves, promised_error * std::max(1.0, three_halves)) << u;
  }
}

// The tolerance is that of differences of values that are right to 1e-4.
TEST(BlurredEdges, TheRootsSlopeIsItsDerivative) {
  const BlurredEdges& edges = BlurredEdges::instance();
  constexpr float h = 0.05F;
  for (float u = -5; u < BlurredEdges::last_u - h; u += 0.0173F) {
    EXPECT_NEAR((edges.at(u + h).root - edges.at(u - h).root) / (2 * h), edges.at(u).root_slope, 2e-3) << u;
  }
}

}  // namespace lapservo::internal::blurred_edges_test
