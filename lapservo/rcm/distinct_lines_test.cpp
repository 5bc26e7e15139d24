#include "lapservo/rcm/distinct_lines.h"

#include <ctime>

#include <gtest/gtest.h>

#include "lapservo/rcm/projected_rcm.h"
#include "lapservo/rcm/test_lines.h"

namespace lapservo::internal::distinct_lines_test {

constexpr int seed = 91;

TEST(DistinctLines, KeepsThoseOfDifferentPositionsAsTheyAre) {
  testing::SeededRandom random(seed);
  const auto lines = testing::fan_of_lines({-200, 900}, 20, 1, random);
  const auto distinct = distinct_lines(lines);
  ASSERT_EQ(distinct.size(), lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    EXPECT_EQ(distinct[i].from_px, lines[i].from_px);
    EXPECT_EQ(distinct[i].to_px, lines[i].to_px);
  }
}

TEST(DistinctLines, RepeatedOnesDoNotMakeTheEstimateMoreCertain) {
  testing::SeededRandom random(seed);
  std::vector<LineObservation> once, often;
  for (const LineObservation& line : testing::fan_of_lines({-200, 900}, 20, 1, random))
    once.push_back(testing::with_error(line, 1, random));
  for (int i = 0; i < 100; ++i) often.insert(often.end(), once.begin(), once.end());
  const auto a = estimate_projected_rcm(once), b = estimate_projected_rcm(distinct_lines(often));
  EXPECT_NEAR((a.point_px - b.point_px).norm(), 0, 1e-6);
  ASSERT_TRUE(a.covariance_px2 && b.covariance_px2);
  EXPECT_NEAR(b.covariance_px2->trace() / a.covariance_px2->trace(), 1, 1e-6);
}

TEST(DistinctLines, FramesOfOnePositionAreOneLineWhereverItLies) {
  testing::SeededRandom random(seed);
  for (int place = 0; place < 50; ++place) {
    const Eigen::Vector2d from(random.uniform(0, 4), random.uniform(0, 4)), along(300, 100);
    std::vector<LineObservation> lines;
    for (int i = 0; i < 30; ++i) lines.push_back(testing::with_error(line_between(from, from + along, 0.2), 1, random));
    EXPECT_EQ(distinct_lines(lines).size(), 1U);
  }
}

TEST(DistinctLines, OfManyNoMoreThanAskedForInLinearTime) {
  testing::SeededRandom random(seed);
  const auto cpu_time_of = [&](std::size_t count) {
    const auto lines = testing::fan_of_lines({-200, 900}, count, 1, random);
    const std::clock_t start = std::clock();
    const auto distinct = distinct_lines(lines);
    EXPECT_LE(distinct.size(), 1000U);
    EXPECT_GT(distinct.size(), 100U);
    return static_cast<double>(std::clock() - start);
  };
  const double few = cpu_time_of(4000), many = cpu_time_of(32000);
  EXPECT_LT(many, 24 * few) << "eight times the lines: 8 times when linear, 64 when quadratic";
}

}  // namespace lapservo::internal::distinct_lines_test
