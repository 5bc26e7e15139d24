#include "lapservo/calibration/marker/print_shape.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/testing/markers.h"

namespace lapservo::internal {
namespace {

using lapservo::testing::askew;
using lapservo::testing::random_marker;

void expect_same(const Marker& a, const Marker& b) {
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(a.bands_upper_m[i], b.bands_upper_m[i], 1e-15);
    EXPECT_NEAR(a.bands_lower_m[i], b.bands_lower_m[i], 1e-15);
  }
  EXPECT_NEAR(a.wrap_m, b.wrap_m, 1e-15);
  EXPECT_NEAR(a.skew_m, b.skew_m, 1e-15);
  EXPECT_NEAR(a.gap_rad, b.gap_rad, 1e-15);
}

TEST(PrintShape, GivesTheMarkerBack) {
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    const Marker marker = askew(random_marker(random), random);
    expect_same(PrintShape::of(marker).on(marker), marker);
  }
}

TEST(PrintShape, SigmasAreThoseOfTheMarkersNumbers) {
  Random random(2);
  const Marker marker = askew(random_marker(random), random);
  PrintCovariance factor;
  for (double& value : factor.reshaped()) value = 1e-5 * random.normal();
  const PrintCovariance covariance = factor * factor.transpose();
  const MarkerSigmas sigmas = sigmas_of(covariance, {});
  constexpr int draws = 20000;
  double upper = 0, lower = 0, skew = 0, wrap = 0, gap = 0;
  for (int i = 0; i < draws; ++i) {
    PrintNumbers normal;
    for (double& value : normal) value = random.normal();
    const Marker drawn = changed_by(PrintShape::of(marker), factor * normal).on(marker);
    const auto square = [](double x) { return x * x / draws; };
    upper += square(drawn.bands_upper_m[1] - marker.bands_upper_m[1]);
    lower += square(drawn.bands_lower_m[0] - marker.bands_lower_m[0]);
    skew += square(drawn.skew_m - marker.skew_m);
    wrap += square(drawn.wrap_m - marker.wrap_m);
    gap += square(drawn.gap_rad - marker.gap_rad);
  }
  EXPECT_NEAR(std::sqrt(upper) / (*sigmas.bands_upper_m)[1], 1, 0.03);
  EXPECT_NEAR(std::sqrt(lower) / (*sigmas.bands_lower_m)[0], 1, 0.03);
  EXPECT_NEAR(std::sqrt(skew) / *sigmas.skew_m, 1, 0.03);
  EXPECT_NEAR(std::sqrt(wrap) / *sigmas.wrap_m, 1, 0.03);
  EXPECT_NEAR(std::sqrt(gap) / *sigmas.gap_rad, 1, 0.03);
}

}  // namespace
}  // namespace lapservo::internal
