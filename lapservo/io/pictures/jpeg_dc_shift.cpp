#include "lapservo/io/pictures/jpeg_dc_shift.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "lapservo/core/statistics.h"

namespace lapservo::internal {
namespace {

constexpr float least_shift = 2;               // brightness levels; less moves no boundary by what matters
constexpr float least_shift_in_quanta = 1.5F;  // one is what rounding makes of a slow change of light
constexpr float least_shift_over_spread = 2;   // a shift is the same everywhere, a scene's edge along a row is not
constexpr float max_spread_over_usual = 1.5F;
constexpr float rounding_spread = 0.5F;  // levels, of blocks without any noise
constexpr float least_noise = 0.3F;      // levels: of camera's images, not of drawn ones
constexpr float min_spread_over_usual = 0.4F;
constexpr int max_tries = 4096;    // of an image made to take time; cameras' have some hundreds
constexpr int borders_beside = 3;  // of which most have to show the shift, or nothing

using Steps = std::vector<float>;

Steps part(const JpegBlocks& blocks, int begin, int end) {
  return {blocks.steps.begin() + begin, blocks.steps.begin() + end};
}

// Noise that three borders in four stay below; the others may belong to misread blocks.
float spread_about(Steps steps, float from) {
  for (float& step : steps) step = std::abs(step - from);
  return quantile(steps, 0.75) + rounding_spread;
}

// Borders around those in which a shift from block `first` on would show.
float usual_spread(const JpegBlocks& blocks, int first) {
  const int count = static_cast<int>(blocks.steps.size()), end = first + blocks.columns;
  Steps around = part(blocks, std::max(first - 2 * blocks.columns, blocks.columns), first);
  const Steps behind = part(blocks, end, std::min(end + 2 * blocks.columns, count));
  around.insert(around.end(), behind.begin(), behind.end());
  return spread_about(std::move(around), 0);
}

float median_of_three(const float* steps) {
  return std::max(std::min(steps[0], steps[1]), std::min(std::max(steps[0], steps[1]), steps[2]));
}

// Bars, labels and masks in an image have edges along rows. A shift from block `first` on shows up to the end of its
// row and from the beginning of the next one, and in nothing before and behind.
bool is_wrapped(const JpegBlocks& blocks, int first) {
  const int next_row = (first / blocks.columns + 1) * blocks.columns, end = first + blocks.columns;
  if (std::min(next_row - first, end - next_row) < borders_beside) return false;
  const auto three_from = [&](int block) { return median_of_three(&blocks.steps[static_cast<std::size_t>(block)]); };
  const float shift = three_from(end - borders_beside);
  const float before = three_from(first - borders_beside), behind = three_from(end);
  return std::abs(shift) > least_shift / 2 && std::abs(before) < std::abs(shift) / 2 &&
         std::abs(behind) < std::abs(shift) / 2;
}

// Shift of all blocks from block `first` on.
std::optional<float> shift_from(const JpegBlocks& blocks, int first) {
  const int next_row = (first / blocks.columns + 1) * blocks.columns, end = first + blocks.columns;
  const Steps borders = part(blocks, first, end);
  const float shift = median(Steps(borders));
  const float spread = spread_about(borders, shift), usual = usual_spread(blocks, first);
  // Drawn images have no noise, and edges as even as a shift's.
  if (usual < least_noise + rounding_spread || spread < min_spread_over_usual * usual) return std::nullopt;
  const float least = std::max({least_shift, least_shift_in_quanta * blocks.quantum, least_shift_over_spread * spread});
  if (std::abs(shift) < least || spread > max_spread_over_usual * usual) return std::nullopt;
  const auto is_shown = [&](int from, int to) { return median(part(blocks, from, to)) / shift > 0.5F; };
  return is_shown(first, next_row) && is_shown(next_row, end) ? std::optional(shift) : std::nullopt;
}

}  // namespace

std::optional<float> dc_shift(const JpegBlocks& blocks) {
  const int count = static_cast<int>(blocks.steps.size());
  const int interval = blocks.restart_interval > 0 ? blocks.restart_interval : count;
  std::vector<double> sums{0};  // of all steps before each block
  for (const float step : blocks.steps) sums.push_back(sums.back() + step);
  int tries = max_tries;
  // The first row has no borders above.
  for (int first = blocks.columns; first + blocks.columns + borders_beside <= count && tries > 0; ++first) {
    const int restart = (first / interval + 1) * interval;
    const int end = first + blocks.columns;
    if (end > restart) continue;
    const double sum = sums[static_cast<std::size_t>(end)] - sums[static_cast<std::size_t>(first)];
    if (std::abs(sum) < least_shift / 2 * blocks.columns || !is_wrapped(blocks, first)) continue;
    --tries;
    if (const auto shift = shift_from(blocks, first)) return shift;
  }
  return std::nullopt;
}

}  // namespace lapservo::internal
