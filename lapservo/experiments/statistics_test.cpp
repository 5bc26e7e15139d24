#include "lapservo/experiments/statistics.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::statistics_test {

constexpr std::uint64_t seed = 72;

TEST(Spread, OfKnownNumbers) {
  const Spread spread = spread_of({2, 4, 4, 4, 5, 5, 7, -9});
  EXPECT_EQ(spread.count, 8U);
  EXPECT_DOUBLE_EQ(spread.mean, 2.75);
  EXPECT_DOUBLE_EQ(spread.median, 4);
  EXPECT_DOUBLE_EQ(spread.largest, 9);
  EXPECT_NEAR(spread.rms, std::sqrt(232.0 / 8), 1e-12);
  EXPECT_NEAR(spread.deviation, std::sqrt((232 - 8 * 2.75 * 2.75) / 7), 1e-12);
  EXPECT_EQ(spread_of({}).count, 0U);
  const Spread none = spread_of({}), one = spread_of({3});
  for (const double unknown : {none.mean, none.rms, none.largest, none.median, one.deviation})
    EXPECT_EQ(with_digits(unknown, 2), unknown_text) << "not the best of all";
  EXPECT_EQ(one.mean, 3);
}

// The mean distance of four points with noise sigma in u and v to their centroid is sigma sqrt(3/4) sqrt(pi/2).
TEST(DistancesToCentroid, MeasureTheNoiseWhereverThePointsAre) {
  Random random(seed);
  std::vector<double> distances;
  for (int i = 0; i < 20000; ++i) {
    const Eigen::Vector2d at(random.uniform(0, 1280), random.uniform(0, 720));
    std::vector<Eigen::Vector2d> points;
    for (int light = 0; light < 4; ++light)
      points.push_back(at + 0.3 * Eigen::Vector2d(random.normal(), random.normal()));
    for (const double distance : distances_to_centroid(points)) distances.push_back(distance);
  }
  EXPECT_EQ(distances.size(), 80000U);
  EXPECT_NEAR(spread_of(distances).mean, 0.3 * std::sqrt(0.75) * std::sqrt(std::acos(-1.0) / 2), 2e-3)
      << "seed " << seed;
  EXPECT_EQ(distances_to_centroid({{3, 4}}), std::vector<double>{0});
  EXPECT_TRUE(distances_to_centroid({}).empty());
}

TEST(Quantile, LiesBetweenTheNumbers) {
  EXPECT_DOUBLE_EQ(quantile_of({4, 1, 3, 2}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile_of({4, 1, 3, 2}, 0), 1);
  EXPECT_DOUBLE_EQ(quantile_of({4, 1, 3, 2}, 1), 4);
  EXPECT_DOUBLE_EQ(quantile_of({0, 10}, 0.9), 9);
  EXPECT_EQ(quantile_of({}, 0.5), 0);
}

TEST(ShareWithin, CountsMagnitudes) {
  EXPECT_DOUBLE_EQ(fraction_within({-0.05, 0.05, 0.15, -0.3}, 0.1), 0.5);
  EXPECT_DOUBLE_EQ(fraction_within({-0.05, 0.05, 0.15, -0.3}, 0.2), 0.75);
  EXPECT_TRUE(std::isnan(fraction_within({}, 1)));
}

TEST(WithDigits, NeverHasAnExponent) {
  EXPECT_EQ(with_digits(318.7, 2), "319");
  EXPECT_EQ(with_digits(18.23, 3), "18.2");
  EXPECT_EQ(with_digits(0.01512, 3), "0.0151");
  EXPECT_EQ(with_digits(-2.5e-7, 2), "-0.00000025");
  EXPECT_EQ(with_digits(0, 3), "0.00");
}

}  // namespace lapservo::internal::statistics_test
