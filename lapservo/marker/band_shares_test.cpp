#include "lapservo/marker/band_shares.h"

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

Marker with_bands(const BandShares& upper_mm, const BandShares& lower_mm) {
  Marker marker;
  for (std::size_t i = 0; i < 3; ++i)
    marker.bands_upper_m[i] = 1e-3 * upper_mm[i], marker.bands_lower_m[i] = 1e-3 * lower_mm[i];
  return marker;
}

TEST(BandShares, AMarkerHasItsOwnAtEachAzimuthAndNotThoseOfAnother) {
  const Marker marker = with_bands({3.5, 3.5, 17}, {10, 10, 4});
  for (double tau_rad = 0; tau_rad < 6.28; tau_rad += 0.1) {
    const auto at_m = boundaries_m(marker, tau_rad);
    BandShares shares{};
    for (std::size_t i = 0; i < 3; ++i) shares[i] = (at_m[i + 1] - at_m[i]) / (at_m[3] - at_m[0]);
    EXPECT_TRUE(has_band_shares(marker, shares)) << tau_rad;
    EXPECT_FALSE(has_band_shares(marker, {shares[0] + 0.15, shares[1] - 0.15, shares[2]})) << tau_rad;
  }
}

}  // namespace
}  // namespace lapservo::internal
