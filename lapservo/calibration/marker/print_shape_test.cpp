#include <gtest/gtest.h>

#include "lapservo/calibration/marker/print_adjustment.h"
#include "lapservo/testing/markers.h"

namespace lapservo::internal::print_shape_test {

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
  const auto numbers_of = [](const auto& upper, const auto& lower, double skew, double wrap, double gap) {
    return Eigen::Matrix<double, 9, 1>(upper[0], upper[1], upper[2], lower[0], lower[1], lower[2], skew, wrap, gap);
  };
  const auto changed = [&](double by, Eigen::Index number) {
    const Marker print = changed_by(PrintShape::of(marker), by * PrintNumbers::Unit(number)).on(marker);
    return numbers_of(print.bands_upper_m, print.bands_lower_m, print.skew_m, print.wrap_m, print.gap_rad);
  };
  Eigen::Matrix<double, 9, print_numbers> slopes;
  for (Eigen::Index k = 0; k < print_numbers; ++k) slopes.col(k) = (changed(1e-5, k) - changed(-1e-5, k)) / 2e-5;
  const Eigen::Matrix<double, 9, 1> expected = (slopes * covariance * slopes.transpose()).diagonal().cwiseSqrt();
  const MarkerSigmas sigmas = sigmas_of(covariance, {});
  const auto found =
      numbers_of(*sigmas.bands_upper_m, *sigmas.bands_lower_m, *sigmas.skew_m, *sigmas.wrap_m, *sigmas.gap_rad);
  for (Eigen::Index i = 0; i < 9; ++i) EXPECT_NEAR(found[i] / expected[i], 1, 0.006) << i << ": they have three digits";
}

}  // namespace lapservo::internal::print_shape_test
