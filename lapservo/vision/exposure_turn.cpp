#include "lapservo/vision/exposure_turn.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "lapservo/vision/limits.h"

namespace lapservo::internal {

double exposure_turn_rad(const Marker& marker, const EdgeMeasurements& edges, const EdgeBlur& blur) {
  std::array<double, 4> along_px_per_m{}, width2_px2{};
  std::array<int, 4> count{};
  for (const Measurement& m : edges.all)
    if (m.group < 4) along_px_per_m[m.group] += m.along_px_per_m, ++count[m.group];
  for (std::size_t k = 0; k < 4; ++k) {
    const BlurEvidence& evidence = edges.blur_of_boundary[k];
    if (count[k] < exposure_limits.min_points || !(evidence.information > 0)) return 0;
    along_px_per_m[k] /= count[k];
    const double width_px = std::max(0.0, blur.boundaries_px + evidence.gradient / evidence.information);
    width2_px2[k] = width_px * width_px;
  }
  const double ends_px2 = (width2_px2[0] + width2_px2[3]) / 2;
  if (blur.sides_px > std::sqrt(ends_px2) + exposure_limits.max_motion_px) return 0;
  const auto slopes_m = boundary_slopes_m(marker);
  const auto speed2 = [&](std::size_t k) {  // squared speed of a boundary in the image [px/rad]^2
    const double speed = slopes_m[k] * along_px_per_m[k];
    return speed * speed;
  };
  const std::size_t fast = speed2(1) > speed2(2) ? 1 : 2, slow = 3 - fast;
  if (speed2(slow) > exposure_limits.max_slow * speed2(fast)) return 0;
  const double by_slow = (width2_px2[fast] - width2_px2[slow]) / (speed2(fast) - speed2(slow));
  const double by_ends = (width2_px2[fast] - ends_px2) / speed2(fast);
  return std::sqrt(12 * std::max(0.0, std::min(by_slow, by_ends)));  // an even turn's variance is a twelfth
}

}  // namespace lapservo::internal
