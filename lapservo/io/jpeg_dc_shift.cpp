#include "lapservo/io/jpeg_dc_shift.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "lapservo/core/median.h"

namespace lapservo::internal {
namespace {

constexpr float least_shift = 2;               // brightness levels; less moves no boundary by what matters
constexpr float least_shift_in_quanta = 1.5F;  // one is what rounding makes of a slow change of light
constexpr float least_shift_over_spread = 2;   // a shift is the same everywhere, a scene's edge along a row is not
constexpr float max_spread_over_usual = 2;
constexpr float rounding_spread = 0.5F;  // levels, of blocks without any noise
constexpr int least_borders = 6;         // fewer look alike by chance
constexpr int borders_beside = 3;        // of which most have to show the shift, or nothing

using Steps = std::vector<float>;

Steps part(const JpegBlocks& blocks, int begin, int end) {
  return {blocks.steps.begin() + begin, blocks.steps.begin() + end};
}

// Of three borders in four; the others may be those of blocks that were misread.
float spread_about(Steps steps, float from) {
  for (float& step : steps) step = std::abs(step - from);
  const auto quartile = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() * 3 / 4);
  std::nth_element(steps.begin(), quartile, steps.end());
  return *quartile + rounding_spread;
}

// Of the borders in the rows around a block's.
float usual_spread(const JpegBlocks& blocks, int block) {
  const int count = static_cast<int>(blocks.steps.size());
  const int begin = std::max(block - 2 * blocks.columns, 0);
  const int end = std::min(block + 3 * blocks.columns, count);
  return spread_about(part(blocks, begin, end), 0);
}

// Bars and masks in a picture have edges along rows, or most of them. A shift shows up to the end of its first row and
// from the beginning of the next one, and in nothing before and behind.
bool is_wrapped(const JpegBlocks& blocks, int first, float shift) {
  const int next_row = (first / blocks.columns + 1) * blocks.columns;
  const int end = first + blocks.columns;
  const auto half_shown = [&](int from, int to) { return median(part(blocks, from, to)) / shift > 0.5F; };
  if (std::min(next_row - first, end - next_row) < borders_beside) return false;
  const bool is_below_another = first > blocks.columns;
  if (is_below_another && (half_shown(first - borders_beside, first) || !half_shown(first, next_row))) return false;
  return half_shown(next_row, end) && !half_shown(end, end + borders_beside);
}

// With a shift from block `first` on, whose borders to blocks that aren't shifted are those from `begin` to `end`.
std::optional<float> shift_from(const JpegBlocks& blocks, int first, int begin, int end) {
  const Steps borders = part(blocks, begin, end);
  const float shift = median(Steps(borders));
  const float spread = spread_about(borders, shift);
  const float least = std::max({least_shift, least_shift_in_quanta * blocks.quantum, least_shift_over_spread * spread});
  if (std::abs(shift) < least || spread > max_spread_over_usual * usual_spread(blocks, first)) return std::nullopt;
  return is_wrapped(blocks, first, shift) ? std::optional(shift) : std::nullopt;
}

}  // namespace

std::optional<float> dc_shift(const JpegBlocks& blocks) {
  const int count = static_cast<int>(blocks.steps.size());
  const int interval = blocks.restart_interval > 0 ? blocks.restart_interval : count;
  std::vector<double> sums{0};
  for (const float step : blocks.steps) sums.push_back(sums.back() + step);
  for (int first = 0; first < count; ++first) {
    const int begin = std::max(first, blocks.columns);  // the first row has none above
    const int end = first + blocks.columns;
    const int restart = (first / interval + 1) * interval;
    if (end - begin < least_borders || end + borders_beside > std::min(count, restart)) continue;
    const double sum = sums[static_cast<std::size_t>(end)] - sums[static_cast<std::size_t>(begin)];
    if (std::abs(sum) < least_shift / 2 * (end - begin)) continue;
    if (const auto shift = shift_from(blocks, first, begin, end)) return shift;
  }
  return std::nullopt;
}

}  // namespace lapservo::internal
