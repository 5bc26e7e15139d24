#include "lapservo/marker/length_code.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/marker/decoder.h"
#include "lapservo/testing/markers.h"

namespace lapservo::internal {
namespace length_code_test {
using testing::marker_with;

constexpr std::uint64_t seed = 47;

double band_m(const Marker& marker, std::size_t band, double tau_rad) {
  const auto e = boundaries_m(marker, tau_rad);
  return e.at(band + 1) - e.at(band);
}

// Eq. (16) on the marker's own lengths, for any marker and each band that changes.
TEST(LengthDecoder, InvertsEveryBandThatChanges) {
  Random random(seed);
  int bands = 0;
  for (int i = 0; i < 100; ++i) {
    const Marker marker = testing::random_marker(random);
    for (std::size_t band = 0; band < 3; ++band) {
      if (!length_decoding_problem(marker, band).empty()) continue;
      ++bands;
      const LengthDecoder decoder(marker, band);
      for (int k = 0; k < 50; ++k) {
        const double tau_rad = random.uniform(0, two_pi);
        ASSERT_NEAR(decoder.tau_rad(band_m(marker, band, tau_rad)), tau_rad, 1e-6) << "seed " << seed;
      }
    }
  }
  EXPECT_GT(bands, 200);
}

TEST(LengthDecoder, ClampsWhatNoBandShows) {
  const Marker marker = marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005});
  EXPECT_EQ(LengthDecoder(marker, 0).tau_rad(0), 0);
  EXPECT_EQ(LengthDecoder(marker, 0).tau_rad(1), two_pi);
  EXPECT_EQ(LengthDecoder(marker, 2).tau_rad(0), two_pi);
  EXPECT_EQ(LengthDecoder(marker, 2).tau_rad(1), 0);
  EXPECT_TRUE(std::isnan(LengthDecoder(marker, 0).tau_rad(std::numeric_limits<double>::infinity())));
}

TEST(LengthDecoder, RefusesABandThatStaysAsLong) {
  const Marker marker = marker_with({0.004, 0.012, 0.008}, {0.012, 0.004, 0.008});
  EXPECT_THROW(LengthDecoder(marker, 2), std::invalid_argument);
  EXPECT_NE(length_decoding_problem(marker, 2).find("band 2"), std::string::npos);
  EXPECT_EQ(length_decoding_problem(marker, 0), "");
  EXPECT_THROW(LengthDecoder(marker, 3), std::out_of_range);
}

TEST(MostTellingBand, ChangesMost) {
  EXPECT_EQ(most_telling_band(marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005})), 2U);
  EXPECT_EQ(most_telling_band(marker_with({0.004, 0.012, 0.008}, {0.012, 0.006, 0.006})), 0U);
}

TEST(PredictedSigmaLength, IsTheSpreadOfWhatIsDecoded) {
  Random random(seed);
  const Viewing viewing{1100, 0.11, 0.05};
  const Marker marker = marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005});
  for (std::size_t band = 0; band < 3; ++band) {
    const LengthDecoder decoder(marker, band);
    constexpr int draws = 20000;
    double squares = 0;
    for (int i = 0; i < draws; ++i) {
      const double ends_px = viewing.sigma_edge_px * (random.normal() - random.normal());
      const double error_rad = decoder.tau_rad(band_m(marker, band, 3) + ends_px / viewing.px_per_m()) - 3;
      squares += error_rad * error_rad;
    }
    EXPECT_NEAR(std::sqrt(squares / draws) / predicted_sigma_length_rad(marker, band, viewing), 1, 0.03) << band;
  }
}

// Why the paper went on to the cross-ratio: a wrong depth or inclination spoils a length, and leaves the cross-ratio.
TEST(PerspectiveErrors, SpoilTheLengthOnly) {
  Random random(seed);
  for (int i = 0; i < 200; ++i) {
    const Marker marker = testing::random_linear_marker(random);
    const std::size_t band = most_telling_band(marker);
    const double tau_rad = random.uniform(1, 5);
    const ViewingError viewing_error{random.uniform(0.01, 0.05), random.uniform(-0.5, 0.5)};
    const CodeErrors errors = perspective_errors(marker, band, tau_rad, {}, viewing_error);
    EXPECT_NEAR(errors.by_cross_ratio_rad, 0, 1e-9) << "seed " << seed;
    const CodeErrors exact = perspective_errors(marker, band, tau_rad, {}, {});
    EXPECT_NEAR(exact.by_length_rad, 0, 1e-9) << "seed " << seed;
    EXPECT_NEAR(exact.by_cross_ratio_rad, 0, 1e-9) << "seed " << seed;
  }
}

// A depth that is wrong by a fraction makes the length wrong by the same fraction.
TEST(PerspectiveErrors, OfALengthAreThoseOfTheDepth) {
  const Marker marker = marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005});
  constexpr double fraction = 0.01, tau_rad = 3;
  for (std::size_t band = 0; band < 3; ++band) {
    const double slope_m = (marker.bands_lower_m.at(band) - marker.bands_upper_m.at(band)) / two_pi;
    EXPECT_NEAR(perspective_errors(marker, band, tau_rad, {}, {fraction, 0}).by_length_rad,
                fraction * band_m(marker, band, tau_rad) / slope_m, 1e-9)
        << band;
  }
}

TEST(PerspectiveErrors, HaveNoCrossRatioWhereItTurnsBack) {
  const Marker marker = marker_with({0.003, 0.003, 0.019}, {0.019, 0.003, 0.003});
  ASSERT_NE(decoding_problem(marker), "");
  const CodeErrors errors = perspective_errors(marker, 0, 2, {}, {});
  EXPECT_NEAR(errors.by_length_rad, 0, 1e-9);
  EXPECT_TRUE(std::isnan(errors.by_cross_ratio_rad));
}

}  // namespace length_code_test
}  // namespace lapservo::internal
