#include "lapservo/rig/joint_travel.h"

#include <cmath>

#include <gtest/gtest.h>

namespace lapservo::internal::joint_travel_test {

const Joints joints{{"yaw", "pitch", "insertion", "roll"}, {1, 1, 1, 1}, {}};

TEST(JointTravel, NamesWhatStoodStillAndHowFarItMustMove) {
  std::vector<std::array<double, 4>> readings;
  for (int i = 0; i < 300; ++i) {
    const double part = std::sin(0.1 * i);
    readings.push_back({0.2 * part, 0.3 + 0.001 * part, 0.1 + 0.002 * part, part});
  }
  readings[40] = {3, 3, 3, 3};  // a wild reading is no motion
  const JointRanges ranges = ranges_of(readings);
  EXPECT_NEAR(ranges.travel(0), 0.4, 2e-3);
  EXPECT_EQ(still_joints(joints, ranges),
            "pitch moved by 0.00 rad only, at least 0.10 rad show its sign and offset, better 0.50 rad; "
            "insertion moved by 4.0 mm only, at least 5.0 mm show its sign and offset, better 20.0 mm");
  EXPECT_EQ(ranges_text(joints, ranges),
            "yaw -0.20 to 0.20 rad, pitch 0.30 to 0.30 rad, insertion 98.0 to 102.0 mm, roll -1.00 to 1.00 rad");
  EXPECT_EQ(travels_text(joints, ranges),
            "yaw moved by 0.40 rad, pitch moved by 0.00 rad, insertion moved by 4.0 mm, roll moved by 2.00 rad");
  EXPECT_EQ(still_joints(joints, {{}, {0.1, 0.1, 0.005, 0.2}}), "");
}

}  // namespace lapservo::internal::joint_travel_test
