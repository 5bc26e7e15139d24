#include "lapservo/crtk/joint_map.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "lapservo/core/random.h"
#include "lapservo/kinematics/rcm_kinematics.h"

namespace lapservo::internal {
namespace joint_map_test {

constexpr double half_pi = std::numbers::pi / 2;

Joints psm() {
  return {{"outer_yaw", "outer_pitch", "outer_insertion", "outer_roll"}, {1, -1, 1, 1}, {0, half_pi, -0.0156, 0}};
}

TEST(JointMap, GoesThereAndBack) {
  Random random(1);
  for (int k = 0; k < 100; ++k) {
    const Eigen::Vector4d q(random.normal(), random.normal(), random.normal(), random.normal());
    EXPECT_TRUE(q_from_joints(psm(), joints_from_q(psm(), q)).isApprox(q, 1e-12));
  }
}

TEST(JointMap, LimitsOfAReversedJointChangePlaces) {
  JointLimits limits;
  limits.lower = {-1, -0.5, 0.01, -4};
  limits.upper = {1, 0.9, 0.24, 4};
  const JointLimits q = limits_of_q(psm(), limits);
  EXPECT_TRUE(q.lower.isApprox(Eigen::Vector4d(-1, half_pi - 0.9, 0.01 - 0.0156, -4)));
  EXPECT_TRUE(q.upper.isApprox(Eigen::Vector4d(1, half_pi + 0.5, 0.24 - 0.0156, 4)));
}

// The dVRK's modified DH table of a PSM: its shaft's axis and roll are those of theta = yaw, phi = pi/2 - pitch, psi =
// roll + constant in an RCM frame that is a fixed rotation of the arm's base.
Eigen::Matrix3d modified_dh(double alpha, double theta) {
  return (Eigen::AngleAxisd(alpha, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(theta, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}
Eigen::Matrix3d base_from_shaft(double yaw, double pitch, double roll) {
  return modified_dh(half_pi, yaw + half_pi) * modified_dh(-half_pi, pitch - half_pi) * modified_dh(half_pi, 0) *
         modified_dh(0, roll);
}
Eigen::Matrix3d rcm_from_instrument(const Eigen::Vector4d& q) {
  return (Eigen::AngleAxisd(q[0], Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(q[1], Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(q[3], Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}
// The largest difference of both over random joints.
double disagreement(const Joints& joints) {
  const auto by_rig = [&](double yaw, double pitch, double roll) {
    return rcm_from_instrument(q_from_joints(joints, {yaw, pitch, 0.1, roll}));
  };
  const Eigen::Matrix3d rcm_from_base = by_rig(0, 0, 0) * base_from_shaft(0, 0, 0).transpose();
  Random random(2);
  double largest = 0;
  for (int k = 0; k < 50; ++k) {
    const double yaw = 0.5 * random.normal(), pitch = 0.3 * random.normal(), roll = random.normal();
    const Eigen::Matrix3d by_dh = rcm_from_base * base_from_shaft(yaw, pitch, roll);
    largest = std::max(largest, (by_dh - by_rig(yaw, pitch, roll)).cwiseAbs().maxCoeff());
  }
  return largest;
}

TEST(JointMap, APsmTurnsAsItsDhTable) {
  Joints joints = psm();
  joints.offset[3] = std::numbers::pi;  // the RCM frame has phi between 0 and pi
  EXPECT_LT(disagreement(joints), 1e-9);
  for (const std::size_t i : {0, 1, 3}) {
    Joints wrong = joints;
    wrong.sign[i] = -wrong.sign[i];
    EXPECT_GT(disagreement(wrong), 0.1) << i;
  }
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
  EXPECT_EQ(unfit_joints(psm(), {"outer_yaw", "outer_pitch", "outer_insertion", "outer_roll", "outer_yaw"}),
            "joints are outer_yaw, outer_pitch, outer_insertion, outer_roll, outer_yaw: outer_yaw stands there twice, "
            "expected each name once");
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
    EXPECT_NE(unfit_joints(joints, bare).find("set_tool_type"), std::string::npos);
  }
  joints.names = {"q1", "q2", "q3", "q4"};  // somebody else's arm
  EXPECT_FALSE(find_joints(joints, since));
  EXPECT_EQ(unfit_joints(joints, since),
            "joints are yaw, pitch, insertion, roll, wrist_pitch, wrist_yaw, expected q1, q2, q3, q4");
  EXPECT_EQ(unfit_joints(psm(), {"yaw", "pitch", "insertion", "disc_1"}),
            "joints are yaw, pitch, insertion, disc_1, expected outer_yaw, outer_pitch, outer_insertion, outer_roll or "
            "yaw, pitch, insertion, roll. The arm knows no instrument: name it on set_tool_type");
}

}  // namespace joint_map_test
}  // namespace lapservo::internal
