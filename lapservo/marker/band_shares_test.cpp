#include "lapservo/marker/band_shares.h"

#include <gtest/gtest.h>

#include "lapservo/testing/markers.h"

namespace lapservo::internal::band_shares_test {

TEST(BandShares, AMarkerHasItsOwnAtEachAzimuthAndNotThoseOfAnother) {
  const Marker marker = testing::marker_with({0.0035, 0.0035, 0.017}, {0.01, 0.01, 0.004});
  for (double tau_rad = 0; tau_rad < 6.28; tau_rad += 0.1) {
    const auto at_m = boundaries_m(marker, tau_rad);
    BandShares shares{};
    for (std::size_t i = 0; i < 3; ++i) shares[i] = (at_m[i + 1] - at_m[i]) / (at_m[3] - at_m[0]);
    EXPECT_TRUE(has_band_shares(marker, shares)) << tau_rad;
    EXPECT_FALSE(has_band_shares(marker, {shares[0] + 0.15, shares[1] - 0.15, shares[2]})) << tau_rad;
  }
}

}  // namespace lapservo::internal::band_shares_test
