#include "lapservo/marker/design.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/markers.h"
#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal::design_test {
using testing::marker_with;

constexpr std::uint64_t seed = 47;

double min_band_m(const Marker& marker) {
  double smallest = marker.bands_upper_m[0];
  for (const auto& bands : {marker.bands_upper_m, marker.bands_lower_m})
    smallest = std::min(smallest, *std::min_element(bands.begin(), bands.end()));
  return smallest;
}

// A member of the linear family within the limits.
Marker random_member(double length_m, double min_m, Random& random) {
  for (;;) {
    const double fraction = random.uniform(0.2, 0.8), a = random.uniform(0, length_m), b = random.uniform(0, length_m);
    const auto bands = [&](double sum_m) {
      return std::array<double, 3>{fraction * sum_m, (1 - fraction) * sum_m, length_m - sum_m};
    };
    const Marker marker = marker_with(bands(a), bands(b));
    if (min_band_m(marker) >= min_m && std::abs(a - b) > 1e-4) return marker;
  }
}

TEST(DesignMarker, KeepsToWhatWasAskedForAndCanBeDecodedByEquation18) {
  testing::SeededRandom random(seed);
  for (int i = 0; i < 12; ++i) {
    DesignSpec spec;
    spec.diameter_m = random.uniform(0.004, 0.015);
    spec.min_band_m = random.uniform(0.002, 0.005);
    spec.length_m = *spec.min_band_m * 3 + random.uniform(0.0005, 0.02);
    spec.hues_deg = {20, 140, 260};
    const Marker marker = design_marker(spec);
    SCOPED_TRACE("design " + std::to_string(i));
    EXPECT_FALSE(marker_problem(marker));
    EXPECT_EQ(decoding_problem(marker), "");
    EXPECT_TRUE(in_linear_family(marker));
    EXPECT_EQ(marker.diameter_m, spec.diameter_m);
    EXPECT_EQ(marker.hues_deg, spec.hues_deg);
    EXPECT_NEAR(marker.length_m(), *spec.length_m, 1e-12);
    EXPECT_GE(min_band_m(marker), *spec.min_band_m - 1e-9);
    const double middle = (cross_ratio_at(marker, 0) + cross_ratio_at(marker, two_pi - 1e-9)) / 2;
    EXPECT_NEAR(cross_ratio_at(marker, pi), middle, 1e-9);
  }
}

TEST(DesignMarker, NoOtherMemberOfTheFamilyIsClearlyBetter) {
  testing::SeededRandom random(seed);
  for (const Viewing& viewing : {Viewing{}, Viewing{700, 0.15, 0.2}}) {
    DesignSpec spec;
    spec.viewing = viewing;
    const Marker marker = design_marker(spec);
    const double best = worst_sigma_centre_line_rad(marker, viewing);
    for (int i = 0; i < 3000; ++i)
      EXPECT_GT(worst_sigma_centre_line_rad(random_member(marker.length_m(), 0.003, random), viewing), 0.99 * best);
    EXPECT_LT(best,
              worst_sigma_centre_line_rad(marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005}), viewing));
  }
}

TEST(DesignMarker, IsThreeDiametersLongWithBandsThatTheCameraResolves) {
  DesignSpec spec;
  EXPECT_NEAR(design_marker(spec).length_m(), 0.025, 1e-12);
  EXPECT_GE(min_band_m(design_marker(spec)), 0.003 - 1e-9);
  spec.viewing = {600, 0.18, 0.1};  // 12 px are 3.6 mm
  EXPECT_GE(min_band_m(design_marker(spec)), 0.0036 - 1e-9);
}

TEST(DesignMarker, RefusesALengthIntoWhichNoBandsFit) {
  DesignSpec spec;
  spec.length_m = 0.009;
  EXPECT_EQ(testing::input_error([&] { design_marker(spec); }),
            "length: no marker: three bands of at least 3.0 mm that change over the turn do not fit into 9.0 mm");
}

TEST(WorstSigma, IsTheLargestOverThePrint) {
  testing::SeededRandom random(seed);
  for (int i = 0; i < 40; ++i) {
    Marker marker = testing::random_linear_marker(random);
    if (i % 2 == 1) marker.gap_rad = 0.5;
    double largest = 0;
    for (int k = 0; k < 2000; ++k) {
      const double tau_rad = marker.covered_rad() * (k + 0.5) / 2000;
      largest = std::max(largest, predicted_sigma_centre_line_rad(marker, tau_rad, {}));
    }
    EXPECT_NEAR(worst_sigma_centre_line_rad(marker, {}) / largest, 1, 0.01) << "design " << i;
  }
}

TEST(InLinearFamily, MeansThatTheCrossRatioRunsStraight) {
  testing::SeededRandom random(seed);
  for (int i = 0; i < 200; ++i) {
    EXPECT_TRUE(in_linear_family(testing::random_linear_marker(random)));
    const Marker any = testing::random_marker(random);
    const double middle = (cross_ratio_at(any, 0) + cross_ratio_at(any, two_pi - 1e-9)) / 2;
    EXPECT_EQ(in_linear_family(any), std::abs(cross_ratio_at(any, pi) - middle) < 1e-5);
  }
}

TEST(DesignMarker, MinimisesThePrintsErrorsWithTheNoise) {
  DesignSpec spec;
  const Marker by_noise = design_marker(spec);
  spec.print_error_m = 0.1e-3;
  const Marker by_both = design_marker(spec);
  const auto worst = [&](const Marker& marker) { return worst_sigma_centre_line_rad(marker, spec.viewing, 0.1e-3); };
  EXPECT_LE(worst(by_both), worst(by_noise) * (1 + 1e-9));
  EXPECT_GT(worst(by_noise), worst_sigma_centre_line_rad(by_noise, spec.viewing));
  EXPECT_TRUE(in_linear_family(by_both));
}

}  // namespace lapservo::internal::design_test
