#include "lapservo/core/inplace_vector.h"

#include <gtest/gtest.h>

namespace lapservo::internal {
namespace {

TEST(InplaceVector, HoldsWhatWasPushedInOrder) {
  InplaceVector<int, 5> values;
  EXPECT_TRUE(values.empty());
  for (int i = 0; i < 5; ++i) values.push_back(10 * i);
  ASSERT_EQ(values.size(), 5U);
  int expected = 0;
  for (const int value : values) {
    EXPECT_EQ(value, expected);
    expected += 10;
  }
  EXPECT_EQ(values[3], 30);
}

TEST(InplaceVector, ThrowsWhenFullAndKeepsItsElements) {
  InplaceVector<int, 2> values;
  values.push_back(1), values.push_back(2);
  EXPECT_THROW(values.push_back(3), std::length_error);
  EXPECT_EQ(values.size(), 2U);
  EXPECT_EQ(values[1], 2);
}

TEST(InplaceVector, CopiesShareNothing) {
  InplaceVector<int, 4> values;
  values.push_back(1), values.push_back(2);
  InplaceVector<int, 4> copy = values;
  copy[0] = 7, copy.push_back(3);
  EXPECT_EQ(values.size(), 2U);
  EXPECT_EQ(values[0], 1);
  values = copy;
  EXPECT_EQ(values.size(), 3U);
  EXPECT_EQ(values[0], 7);
  values.clear();
  EXPECT_TRUE(values.empty());
}

}  // namespace
}  // namespace lapservo::internal
