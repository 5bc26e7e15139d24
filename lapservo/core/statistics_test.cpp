#include "lapservo/core/statistics.h"

#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/core/spread.h"

namespace lapservo::internal::statistics_test {

TEST(Statistics, AQuantileIsOneOfTheValuesAndTheMedianOfAnEvenNumberTheUpperOne) {
  std::vector<int> values{9, 3, 5, 1, 7};
  for (const auto& [fraction, value] : {std::pair(0.0, 1), std::pair(0.2, 3), std::pair(0.79, 7), std::pair(0.99, 9)})
    EXPECT_EQ(quantile(values, fraction), value) << fraction;
  EXPECT_EQ(quantile(std::vector{4.0F}, 0.9), 4.0F);
  EXPECT_EQ(median(std::vector{3, 1, 2}), 2);
  EXPECT_EQ(median(std::vector{4, 1, 3, 2}), 3);
}

TEST(Statistics, TheRootMeanSquareIsOfValuesMembersAndFunctions) {
  struct Item {
    double error;
  };
  EXPECT_DOUBLE_EQ(rms(std::vector<double>{3, -4, 0, 0}), 2.5);
  EXPECT_DOUBLE_EQ(rms(std::vector<Item>{{1}, {7}}, &Item::error), 5);
  EXPECT_DOUBLE_EQ(rms(std::vector<Item>{{1}, {7}}, [](const Item& item) { return 2 * item.error; }), 10);
  EXPECT_EQ(rms(std::vector<double>{}), 0);
}

TEST(Spread, KeepsSomeOfManyItems) {
  Spread<int> kept(8);
  for (int i = 0; i < 100; ++i) kept.add([i] { return i; });
  const std::vector<int>& items = kept.items();
  ASSERT_LE(items.size(), 8U);
  ASSERT_GE(items.size(), 4U);
  for (std::size_t i = 0; i < items.size(); ++i) EXPECT_EQ(items[i], static_cast<int>(i) * items[1]);
}

}  // namespace lapservo::internal::statistics_test
