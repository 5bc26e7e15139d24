#include "lapservo/core/inplace_vector.h"

#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

namespace lapservo::internal::inplace_vector_test {

TEST(InplaceVector, HoldsWhatWasPushedUntilItIsFullAndCopiesShareNothing) {
  InplaceVector<int, 2> values;
  EXPECT_TRUE(values.empty());
  values.push_back(1), values.push_back(2);
  EXPECT_THROW(values.push_back(3), std::length_error);
  InplaceVector<int, 2> copy = values;
  copy[0] = 7;
  EXPECT_EQ(std::vector<int>(values.begin(), values.end()), (std::vector{1, 2}));
  values.clear();
  EXPECT_TRUE(values.empty());
  values = copy;
  EXPECT_EQ(std::vector<int>(values.begin(), values.end()), (std::vector{7, 2}));
}

}  // namespace lapservo::internal::inplace_vector_test
