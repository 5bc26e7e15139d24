#include "lapservo/marker/band_shares.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/core/angles.h"

namespace lapservo::internal {
namespace {

constexpr double most_off = 0.06;
constexpr int azimuths = 36;

}  // namespace

bool has_band_shares(const Marker& marker, const BandShares& seen) {
  for (int k = 0; k < azimuths; ++k) {
    const auto at_m = boundaries_m(marker, two_pi * k / azimuths);
    double worst = 0;
    for (std::size_t i = 0; i < seen.size(); ++i)
      worst = std::max(worst, std::abs((at_m[i + 1] - at_m[i]) / (at_m[3] - at_m[0]) - seen[i]));
    if (worst <= most_off) return true;
  }
  return false;
}

}  // namespace lapservo::internal
