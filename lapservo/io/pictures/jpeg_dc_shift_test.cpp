#include "lapservo/io/pictures/jpeg_dc_shift.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal {
namespace jpeg_dc_shift_test {

constexpr std::uint64_t seed = 20261122;
constexpr int columns = 40, rows = 20;

// Borders of an image with texture, and with blocks beyond all measure every now and then.
std::vector<float> texture(Random& random) {
  std::vector<float> steps(columns * rows);
  for (float& step : steps) step = static_cast<float>(random.normal() * (random.bits() % 8 == 0 ? 20 : 1));
  std::fill_n(steps.begin(), columns, 0.F);
  return steps;
}

void lift(std::vector<float>& steps, int begin, int end, float by) {
  for (int i = std::max(begin, columns); i < end; ++i) steps[static_cast<std::size_t>(i)] += by;
}

TEST(DcShift, TextureHasNone) {
  Random random(seed);
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(dc_shift({texture(random), 0.25F, columns, 0})) << "picture " << i;
}

TEST(DcShift, AnEdgeAlongWholeRowsOrPartsOfThemIsNone) {
  Random random(seed);
  for (int length = 4; length <= columns; ++length) {
    std::vector<float> bar = texture(random);
    lift(bar, 5 * columns, 5 * columns + length, 30);
    lift(bar, 9 * columns + columns - length, 10 * columns, -30);
    EXPECT_FALSE(dc_shift({bar, 0.25F, columns, 0})) << length << " blocks";
  }
}

TEST(DcShift, WhatRoundingMakesOfSlowChangesIsNone) {
  Random random(seed);
  std::vector<float> steps = texture(random);
  lift(steps, 130, 130 + columns, 8);
  EXPECT_TRUE(dc_shift({steps, 0.25F, columns, 0}));
  EXPECT_FALSE(dc_shift({steps, 8, columns, 0}));
}

// Labels and bars of screens, higher on one side than on the other: the same step all along, and no noise.
TEST(DcShift, WhatIsDrawnIsNone) {
  Random random(seed);
  for (int row = 0; row < rows - 2; ++row)
    for (int column = 1; column < columns; ++column) {
      const int first = row * columns + column;
      std::vector<float> drawn(columns * rows);
      lift(drawn, first, first + columns, 30);
      EXPECT_FALSE(dc_shift({drawn, 0.25F, columns, 0})) << "alone, from block " << first;
      std::vector<float> over = texture(random);
      for (int i = std::max(first, columns); i < first + columns; ++i) over[static_cast<std::size_t>(i)] = 30;
      EXPECT_FALSE(dc_shift({over, 0.25F, columns, 0})) << "over an image, from block " << first;
    }
}

TEST(DcShift, EndsAtARestart) {
  Random random(seed);
  std::vector<float> steps = texture(random);
  lift(steps, 130, 130 + columns, 8);
  EXPECT_TRUE(dc_shift({steps, 0.25F, columns, 200}));
  EXPECT_FALSE(dc_shift({steps, 0.25F, columns, 160})) << "a shift would end at block 160";
  EXPECT_FALSE(dc_shift({steps, 0.25F, columns, 7}));
}

}  // namespace jpeg_dc_shift_test
}  // namespace lapservo::internal
