#include "lapservo/robot/backlash.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "lapservo/core/random.h"

namespace lapservo::internal::backlash_test {

TEST(Backlash, KeepsTheInstrumentWithinTheGap) {
  Random random(1);
  for (const double width : {0.0, 0.3}) {
    Backlash backlash;
    double motor = 0, instrument = 0;
    for (int k = 0; k < 20000; ++k) {
      motor += 0.1 * random.normal();
      instrument = std::clamp(instrument, motor - width / 2, motor + width / 2);
      backlash.follow(motor, width);
      ASSERT_NEAR(backlash.instrument(width), instrument, 1e-9) << k;
    }
  }
}

TEST(Backlash, FollowsAWidthThatChanges) {
  Backlash backlash(0, 1);
  backlash.follow(1, 0);
  EXPECT_EQ(backlash.instrument(0.2), 0.9);
  backlash.follow(0.85, 0.2);
  EXPECT_EQ(backlash.instrument(0.2), 0.9) << "within the gap";
  backlash.follow(0.7, 0.2);
  EXPECT_EQ(backlash.instrument(0.2), 0.7 + 0.1) << "beyond it";
}

}  // namespace lapservo::internal::backlash_test
