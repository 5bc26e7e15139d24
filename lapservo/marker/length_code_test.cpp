#include "lapservo/marker/length_code.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "lapservo/core/angles.h"
#include "lapservo/core/random.h"
#include "lapservo/testing/markers.h"

namespace lapservo::internal {
namespace length_code_test {
using testing::marker_with;

constexpr std::uint64_t seed = 47;

// Eq. (16) on the marker's own lengths, for any marker and each band that changes.
TEST(TauByLength, InvertsEveryBandThatChanges) {
  Random random(seed);
  int bands = 0;
  for (int i = 0; i < 100; ++i) {
    const Marker marker = testing::random_marker(random);
    for (std::size_t band = 0; band < 3; ++band) {
      if (std::abs(marker.bands_lower_m[band] - marker.bands_upper_m[band]) <= 1e-6 * marker.length_m()) continue;
      ++bands;
      for (int k = 0; k < 50; ++k) {
        const double tau_rad = random.uniform(0, two_pi);
        const auto e = boundaries_m(marker, tau_rad);
        ASSERT_NEAR(tau_by_length_rad(marker, band, e[band + 1] - e[band]), tau_rad, 1e-6) << "seed " << seed;
      }
    }
  }
  EXPECT_GT(bands, 200);
}

TEST(TauByLength, ClampsWhatNoBandShows) {
  const Marker marker = marker_with({0.0035, 0.0035, 0.017}, {0.0095, 0.0095, 0.005});
  EXPECT_EQ(tau_by_length_rad(marker, 0, 0), 0);
  EXPECT_EQ(tau_by_length_rad(marker, 0, 1), two_pi);
  EXPECT_EQ(tau_by_length_rad(marker, 2, 0), two_pi);
  EXPECT_EQ(tau_by_length_rad(marker, 2, 1), 0);
  EXPECT_TRUE(std::isnan(tau_by_length_rad(marker, 0, std::numeric_limits<double>::infinity())));
}

TEST(TauByLength, RefusesABandThatStaysAsLong) {
  const Marker marker = marker_with({0.004, 0.012, 0.008}, {0.012, 0.004, 0.008});
  EXPECT_THROW(tau_by_length_rad(marker, 2, 0.008), std::invalid_argument);
  EXPECT_THROW(tau_by_length_rad(marker, 3, 0.008), std::out_of_range);
}

}  // namespace length_code_test
}  // namespace lapservo::internal
