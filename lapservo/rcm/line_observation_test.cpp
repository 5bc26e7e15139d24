#include "lapservo/rcm/line_observation.h"

#include <cmath>

#include <gtest/gtest.h>

namespace lapservo::internal::line_observation_test {

TEST(LineObservation, ToldApartFromWhatIsNone) {
  EXPECT_TRUE(is_usable(line_between({0, 0}, {100, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({7, 7}, {7, 7}, 1)));
  EXPECT_FALSE(is_usable(line_between({NAN, 0}, {100, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({0, 0}, {1e200, 50}, 1)));
  EXPECT_FALSE(is_usable(line_between({0, 0}, {100, 50}, NAN)));
}

}  // namespace lapservo::internal::line_observation_test
