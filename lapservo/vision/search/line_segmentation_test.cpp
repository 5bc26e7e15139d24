#include "lapservo/vision/search/line_segmentation.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::line_segmentation_test {

using Line = std::vector<std::uint8_t>;
const std::array<std::uint8_t, 3> bands{1, 2, 3};

std::size_t state_at(const LineSegmentation& split, std::size_t sample) {
  return static_cast<std::size_t>(std::count_if(split.position.begin(), split.position.end(), [&](double position) {
    return position <= static_cast<double>(sample);
  }));
}

double reward_of(const LineSegmentation& split, const Line& line) {
  double sum = 0;
  for (std::size_t i = 0; i < line.size(); ++i) sum += line_reward(state_at(split, i), line[i], bands);
  return sum;
}

// The best reward of all ways to go on from `state`, one state further at most with every sample.
double best_from(const Line& line, std::size_t sample, std::size_t state) {
  if (sample == line.size()) return 0;
  double rest = best_from(line, sample + 1, state);
  if (state < 4) rest = std::max(rest, best_from(line, sample + 1, state + 1));
  return line_reward(state, line[sample], bands) + rest;
}

Line clean_line(const std::array<std::size_t, 4>& boundaries, std::size_t count) {
  Line line(count, 0);
  for (std::size_t band = 0; band < 3; ++band)
    std::fill(line.begin() + static_cast<std::ptrdiff_t>(boundaries[band]),
              line.begin() + static_cast<std::ptrdiff_t>(boundaries[band + 1]), bands[band]);
  return line;
}

TEST(LineSegmentation, IsTheBestOfAllSplits) {
  Random random(1);
  const std::array<std::uint8_t, 6> colours{0, 1, 2, 3, 4, Scene::outside};
  for (int i = 0; i < 400; ++i) {
    Line line(1 + random.bits() % 11);
    for (std::uint8_t& colour : line) colour = colours[random.bits() % colours.size()];
    if (i % 2) std::sort(line.begin(), line.end());  // in the right order, so that splits are worth something
    double best = -1e9;
    for (std::size_t state = 0; state < 5; ++state) best = std::max(best, best_from(line, 0, state));
    EXPECT_NEAR(reward_of(segment_line(line, bands), line), best, 1e-5) << "seed 1, line " << i;
  }
}

// Blood and highlights (no colour) in stretches, noise (any colour) in single samples.
TEST(LineSegmentation, StandsBlotchesAndNoise) {
  Random random(3);
  const std::array<std::size_t, 4> boundaries{30, 62, 85, 130};
  int seen = 0, off = 0;
  constexpr int lines = 300;
  for (int i = 0; i < lines; ++i) {
    Line line = clean_line(boundaries, 160);
    for (std::uint8_t& colour : line)
      if (random.uniform() < 0.1) colour = static_cast<std::uint8_t>(random.bits() % 4);
    const auto blotch = line.begin() + static_cast<std::ptrdiff_t>(random.uniform(30, 110));
    std::fill(blotch, blotch + 8, 0);
    const LineSegmentation split = segment_line(line, bands);
    for (std::size_t k = 0; k < 4; ++k) {
      if (!split.seen[k]) continue;
      ++seen;
      off += std::abs(split.position[k] - static_cast<double>(boundaries[k])) > 2;
    }
  }
  EXPECT_GT(seen, 0.8 * 4 * lines) << "seed 3";
  EXPECT_LT(off, 0.03 * seen) << "seed 3: a blotch that touches an end looks like the end";
}

TEST(LineSegmentation, SeesNoBoundaryBeyondTheImageOrWithoutColours) {
  Line line = clean_line({30, 62, 85, 130}, 160);
  std::fill(line.begin() + 100, line.end(), Scene::outside);
  LineSegmentation split = segment_line(line, bands);
  EXPECT_EQ(split.seen, (std::array{true, true, true, false}));
  EXPECT_EQ(split.position, (std::array{30.0, 62.0, 85.0, 160.0}));
  line = clean_line({30, 62, 85, 130}, 160);
  std::fill(line.begin(), line.begin() + 50, Scene::outside);
  split = segment_line(line, bands);
  EXPECT_EQ(split.seen, (std::array{false, true, true, true}));
  for (const std::uint8_t colour : {std::uint8_t{0}, std::uint8_t{4}, Scene::outside})
    EXPECT_EQ(segment_line(Line(160, colour), bands).seen, (std::array<bool, 4>{})) << int{colour};
  EXPECT_EQ(segment_line({}, bands).seen, (std::array<bool, 4>{}));
}

// Another instrument's marker: the same colours in another order.
TEST(LineSegmentation, SeesNoWholeMarkerInAnotherOrderOfItsColours) {
  const Line line = clean_line({30, 62, 85, 130}, 160);
  for (const std::array<std::uint8_t, 3>& other : {std::array<std::uint8_t, 3>{2, 3, 1}, {3, 1, 2}, {3, 2, 1}}) {
    const auto seen = segment_line(line, other).seen;
    EXPECT_LT(std::count(seen.begin(), seen.end(), true), 4);
  }
}

}  // namespace lapservo::internal::line_segmentation_test
