#include "lapservo/core/random.h"

#include <array>
#include <cmath>
#include <cstdint>

#include <gtest/gtest.h>

#include "lapservo/testing/seeded_random.h"

namespace lapservo::internal {
namespace random_test {
namespace {

constexpr std::uint64_t seed = 12;
constexpr int draws = 200000;

// The reference values for the seed 1234567: experiments that others repeat from a seed depend on them.
TEST(Random, IsSplitmix64) {
  Random random(1234567);
  for (const std::uint64_t expected : {6457827717110365317ULL, 3203168211198807973ULL, 9817491932198370423ULL})
    EXPECT_EQ(random.bits(), expected);
}

TEST(Random, UniformFillsItsIntervalEvenly) {
  testing::SeededRandom random(seed);
  std::array<int, 10> counts{};
  for (int i = 0; i < draws; ++i) {
    const double x = random.uniform(-2, 3);
    ASSERT_GE(x, -2);
    ASSERT_LT(x, 3);
    ++counts.at(static_cast<std::size_t>((x + 2) * 2));
  }
  for (const int count : counts) EXPECT_NEAR(count, draws / 10, 6 * std::sqrt(draws * 0.1 * 0.9));
}

TEST(Random, NormalsAreStandardAndUncorrelated) {
  testing::SeededRandom random(seed);
  double s1 = 0, s2 = 0, s4 = 0, products = 0, last = 0;
  for (int i = 0; i < draws; ++i) {
    const double x = random.normal();
    s1 += x, s2 += x * x, s4 += x * x * x * x, products += last * x;
    last = x;
  }
  constexpr double n = draws;
  EXPECT_NEAR(s1 / n, 0, 5 / std::sqrt(n));
  EXPECT_NEAR(s2 / n, 1, 5 * std::sqrt(2 / n));
  EXPECT_NEAR(s4 / s2 / s2 * n, 3, 5 * std::sqrt(24 / n));
  EXPECT_NEAR(products / n, 0, 5 / std::sqrt(n));
}

}  // namespace
}  // namespace random_test
}  // namespace lapservo::internal
