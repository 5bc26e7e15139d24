#include "lapservo/crtk/wrist_history.h"

#include <cmath>

#include <gtest/gtest.h>

namespace lapservo::internal::wrist_history_test {

TEST(WristHistory, HasTheReadingThatCameNearestToATime) {
  const std::vector<std::string> names{"wrist_pitch"};
  WristHistory history;
  EXPECT_TRUE(history.at(names, 0).empty());
  for (int i = 0; i <= 200; ++i) history.add({0, {"roll", "outer_wrist_pitch"}, {7, 0.1 * i}}, 10 + 0.01 * i);
  history.add({0, {"elbow"}, {7}}, 12);            // of another arm
  history.add({0, {"wrist_pitch"}, {NAN}}, 12);    // of one that is not homed
  history.add({0, {"wrist_pitch"}, {}}, 12.0001);  // damaged
  EXPECT_EQ(history.at(names, 11.503), (std::vector<double>{0.1 * 150}));
  EXPECT_EQ(history.at(names, 12.2), (std::vector<double>{0.1 * 200}));
  EXPECT_TRUE(history.at(names, 12.3).empty());
  EXPECT_TRUE(history.at(names, 10.7).empty()) << "forgotten";
  EXPECT_TRUE(history.at({"wrist_pitch", "wrist_yaw"}, 12).empty());
}

}  // namespace lapservo::internal::wrist_history_test
