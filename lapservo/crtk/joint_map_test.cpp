#include "lapservo/crtk/joint_map.h"

#include <numbers>

#include <gtest/gtest.h>

namespace lapservo::internal::joint_map_test {

constexpr double half_pi = std::numbers::pi / 2;

Joints psm() {
  return {{"outer_yaw", "outer_pitch", "outer_insertion", "outer_roll"}, {1, -1, 1, 1}, {0, half_pi, -0.0156, 0}};
}

TEST(JointMap, LimitsOfAReversedJointChangePlaces) {
  JointLimits limits;
  limits.lower = {-1, -0.5, 0.01, -4};
  limits.upper = {1, 0.9, 0.24, 4};
  const JointLimits q = limits_of_q(psm(), limits);
  EXPECT_TRUE(q.lower.isApprox(Eigen::Vector4d(-1, half_pi - 0.9, 0.01 - 0.0156, -4)));
  EXPECT_TRUE(q.upper.isApprox(Eigen::Vector4d(1, half_pi + 0.5, 0.24 - 0.0156, 4)));
}

TEST(JointMap, FindsTheFourAmongOthersAndRefusesMissingAndRepeatedOnes) {
  const auto places =
      find_joints(psm(), {"wrist", "outer_roll", "outer_insertion", "outer_pitch", "outer_yaw", "gripper", "wrist"});
  ASSERT_TRUE(places);
  EXPECT_EQ(*places, (std::array<std::size_t, 4>{4, 3, 2, 1}));
  EXPECT_FALSE(find_joints(psm(), {"outer_yaw", "outer_pitch", "outer_insertion"}));
  EXPECT_FALSE(find_joints(psm(), {"outer_yaw", "outer_pitch", "outer_insertion", "outer_roll", "outer_yaw"}));
  EXPECT_FALSE(find_joints(psm(), {}));
  EXPECT_NE(unfit_joints(psm(), {}).find("home the arm"), std::string::npos);
  EXPECT_EQ(repeated_joint(psm(), {"yaw", "pitch", "pitch", "insertion", "roll"}), "pitch");
  EXPECT_EQ(repeated_joint(psm(), {"wrist", "outer_yaw", "wrist"}), "");
}

TEST(JointMap, KnowsADvrksNamesOfBothTimes) {
  const std::vector<std::string> since{"yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw"};
  Joints joints = psm();
  EXPECT_EQ(find_joints(joints, since), (std::array<std::size_t, 4>{0, 1, 2, 3}));
  joints.names = {"yaw", "pitch", "insertion", "roll"};
  EXPECT_TRUE(find_joints(joints, {"outer_yaw", "outer_pitch", "outer_insertion", "outer_roll"}));
  EXPECT_FALSE(find_joints(joints, {"outer_yaw", "pitch", "insertion", "roll"}));
  for (const char* of_no_tool : {"jaw", "disc_4"}) {
    auto bare = since;
    bare.push_back(of_no_tool);
    EXPECT_FALSE(find_joints(joints, bare)) << of_no_tool;
    const std::string said =
        std::string(" without ") + of_no_tool + ". A dVRK's arm has it while it knows no instrument";
    EXPECT_NE(unfit_joints(joints, bare).find(said), std::string::npos);
  }
  joints.names = {"q1", "q2", "q3", "q4"};  // somebody else's arm
  EXPECT_FALSE(find_joints(joints, since));
  EXPECT_EQ(unfit_joints(joints, since),
            "has the joints yaw, pitch, insertion, roll, wrist_pitch, wrist_yaw, expected q1, q2, q3, q4");
}

}  // namespace lapservo::internal::joint_map_test
