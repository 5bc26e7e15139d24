#include "lapservo/calibration/camera/board_edge_profile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Core>

namespace lapservo::internal {
namespace {

constexpr double clear_of_corner_blurs = 4;       // from a corner: there its other edge does not show
constexpr double least_variance = 0.002 * 0.002;  // rounding to 8 bits, and more

// Sums over the pixels of a part of a profile.
struct Bin {
  int count = 0;
  double distance_px = 0, distance_px2 = 0, light = 0, value = 0, squares = 0;

  void add(double at_px, double pixel_light, double pixel_value) {
    ++count, distance_px += at_px, distance_px2 += at_px * at_px;
    light += pixel_light, value += pixel_value, squares += pixel_value * pixel_value;
  }
  void add(const Bin& other) {
    count += other.count, light += other.light, value += other.value, squares += other.squares;
  }
  double variance() const { return std::max(0.0, squares / count - value / count * value / count); }
};

}  // namespace

std::optional<BoardEdgeProfile> profile_of(const EdgePixels& edge, int towards_bright, int channel, double blur_px,
                                           const Response& response) {
  const LightTable light = response.table();
  const auto c = static_cast<std::size_t>(channel);
  const int half = static_cast<int>(edge.reach_px / profile_step_px);
  const auto size = static_cast<std::size_t>(2 * half + 1);
  std::vector<Bin> bins(size);
  for (const EdgePixel& pixel : edge.pixels) {
    if (pixel.value[c] >= 252) return std::nullopt;
    const double to_corner_px = std::min(pixel.fraction, 1 - pixel.fraction) * edge.path.length_px;
    if (to_corner_px < clear_of_corner_blurs * blur_px) continue;
    const double towards_px = towards_bright * pixel.distance_px;
    const long bin = std::lround(towards_px / profile_step_px);
    if (std::abs(bin) > half) continue;
    bins[static_cast<std::size_t>(bin + half)].add(towards_px, light[pixel.value[c]], pixel.value[c] / 255.0);
  }
  BoardEdgeProfile profile;
  profile.blur_px = blur_px;
  const Eigen::Vector2d along = edge.path.along.cwiseAbs();
  profile.angle_rad = std::atan2(along.minCoeff(), along.maxCoeff());
  constexpr int least = 4;
  profile.value.assign(size, std::numeric_limits<double>::quiet_NaN());
  profile.sigma.assign(size, 0), profile.at_px.assign(size, 0), profile.spread_px2.assign(size, 0);
  for (std::size_t i = 0; i < size; ++i) {
    const Bin& bin = bins[i];
    if (bin.count < least) continue;
    profile.value[i] = response.value_from_light(std::clamp(bin.light / bin.count, 0.0, 1.0));
    profile.at_px[i] = bin.distance_px / bin.count;
    profile.spread_px2[i] = std::max(0.0, bin.distance_px2 / bin.count - profile.at_px[i] * profile.at_px[i]);
  }
  Bin dark, bright;
  for (std::size_t i = 0; i < size / 5; ++i) dark.add(bins[i]), bright.add(bins[size - 1 - i]);
  if (dark.count < 3 * least || bright.count < 3 * least) return std::nullopt;
  profile.dark = response.value_from_light(dark.light / dark.count);
  profile.bright = response.value_from_light(bright.light / bright.count);
  if (profile.bright - profile.dark < 0.05) return std::nullopt;
  for (std::size_t i = 0; i < size; ++i) {
    if (!std::isfinite(profile.value[i])) continue;
    const double part = std::clamp((profile.value[i] - profile.dark) / (profile.bright - profile.dark), 0.0, 1.0);
    profile.sigma[i] =
        std::sqrt(((1 - part) * dark.variance() + part * bright.variance() + least_variance) / bins[i].count);
  }
  return profile;
}

}  // namespace lapservo::internal
