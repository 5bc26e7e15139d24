#include "lapservo/rcm/pairwise_mean.h"

#include <gtest/gtest.h>

#include "lapservo/rcm/test_lines.h"

namespace lapservo::internal::pairwise_mean_test {

TEST(PairwiseMean, IsExactWithoutNoise) {
  testing::SeededRandom random(63);
  for (std::size_t count = 2; count < 30; ++count) {
    const Eigen::Vector2d point(random.uniform(-2000, 2000), random.uniform(-2000, 2000));
    const auto mean = mean_of_intersections(testing::fan_of_lines(point, count, 1.5, random));
    ASSERT_TRUE(mean);
    EXPECT_LT((mean->point_px - point).norm(), 1e-4);
    EXPECT_EQ(mean->pairs, count * (count - 1) / 2);
    EXPECT_EQ(mean->covariance_px2.has_value(), count > 2);
  }
}

TEST(PairwiseMean, WeighsEveryPairTheSame) {
  const std::vector<LineObservation> triangle{line_between({0, 0}, {1, 0}, 1), line_between({0, 0}, {0, 1}, 5),
                                              line_between({3, 0}, {0, 6}, 1)};
  EXPECT_LT((mean_of_intersections(triangle)->point_px - Eigen::Vector2d(1, 2)).norm(), 1e-12);
}

// Well spread lines, where the mean of the intersections has a variance.
TEST(PairwiseMean, JackknifeIsAboutRight) {
  testing::SeededRandom random(64);
  const Eigen::Vector2d point(-300, -250);
  double squares = 0, expected = 0;
  constexpr int trials = 300;
  for (int trial = 0; trial < trials; ++trial) {
    std::vector<LineObservation> lines;
    for (int i = 0; i < 12; ++i) {
      const double angle = pi / 12 * i;
      const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
      lines.push_back(testing::with_error(line_between(point + 300 * along, point + 600 * along, 0.3), 1, random));
    }
    const auto mean = mean_of_intersections(lines);
    squares += (mean->point_px - point).squaredNorm();
    expected += mean->covariance_px2->trace();
  }
  EXPECT_GT(squares / expected, 0.5);
  EXPECT_LT(squares / expected, 1.5);
}

TEST(PairwiseMean, NeedsTwoLinesThatMeet) {
  EXPECT_FALSE(mean_of_intersections({}));
  const std::vector<LineObservation> parallel{line_between({0, 0}, {9, 0}, 1), line_between({0, 1}, {9, 1}, 1),
                                              line_between({3, 3}, {3, 3}, 1)};
  EXPECT_FALSE(mean_of_intersections(parallel));
}

}  // namespace lapservo::internal::pairwise_mean_test
