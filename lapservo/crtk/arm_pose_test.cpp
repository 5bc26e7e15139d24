#include "lapservo/crtk/arm_pose.h"

#include <limits>

#include <gtest/gtest.h>

#include "lapservo/crtk/dvrk_frames.h"
#include "lapservo/crtk/test_transport.h"
#include "lapservo/geometry/rotation.h"

namespace lapservo::internal::arm_pose_test {

class ArmPoseTest : public ::testing::Test {
 protected:
  // From a computer whose clock is 100 s ahead, 10 ms on its way.
  void say(const std::string& topic, double time_s, const Rigid3& pose, std::uint64_t source = 0) {
    clock_.now = time_s + 0.01;
    transport_.say(topic, PlaceMessage{time_s + 100, "", pose, source});
  }
  static Rigid3 at(double x) { return {Eigen::Quaterniond::Identity(), {x, 0, 0}}; }

  TestTransport transport_;
  StandingClock clock_;  // as far on as the messages are
};

TEST_F(ArmPoseTest, IsTheArmsOwnWhereThatComesInTime) {
  const ArmPose pose(transport_, "/dvrk/ECM", clock_);
  EXPECT_FALSE(pose.newest());
  say("/dvrk/ECM/measured_cp", 1, at(1));
  EXPECT_FALSE(pose.newest());
  say("/dvrk/ECM/local/measured_cp", 1.4, at(2));
  say("/dvrk/ECM/measured_cp", 3, at(3));
  EXPECT_EQ(pose.newest()->translation.x(), 2);
}

// The two topics may count from other bases.
TEST_F(ArmPoseTest, AnEndoscopeThatHasBegunStaysWithItsTopic) {
  const ArmPose arm(transport_, "ECM", clock_);
  HeldEndoscope endoscope(arm);
  say("/ECM/measured_cp", 1, at(1));
  EXPECT_FALSE(endoscope.begin());
  say("/ECM/measured_cp", 1.6, at(1));
  ASSERT_TRUE(endoscope.begin());
  say("/ECM/local/measured_cp", 1.62, at(1.01));
  say("/ECM/measured_cp", 1.64, at(1));
  const auto moved = endoscope.first_from_camera(1.65);
  ASSERT_TRUE(moved);
  EXPECT_LT(moved->translation.norm(), 1e-9);
}

TEST_F(ArmPoseTest, OneThatIsNoneDoesNotCount) {
  const ArmPose pose(transport_, "ECM", clock_);
  say("/ECM/measured_cp", 1, at(std::numeric_limits<double>::quiet_NaN()));
  say("/ECM/measured_cp", 2, {Eigen::Quaterniond(0, 0, 0, 0), {1, 0, 0}});
  EXPECT_FALSE(pose.newest());
}

// Two simulators of one name, for example: whose poses are right, nobody knows.
TEST_F(ArmPoseTest, OfTwoProgramsNobodysPosesCount) {
  const ArmPose pose(transport_, "ECM", clock_);
  say("/ECM/measured_cp", 1, at(1), 7);
  say("/ECM/measured_cp", 1.1, at(5), 8);
  say("/ECM/measured_cp", 1.2, at(1), 7);
  EXPECT_FALSE(pose.newest());
  EXPECT_TRUE(pose.has_two_senders());
  say("/ECM/measured_cp", 1.65, at(2), 7);
  EXPECT_FALSE(pose.has_two_senders());
  EXPECT_EQ(pose.newest()->translation.x(), 2);
  say("/ECM/measured_cp", 2.3, at(3), 8);  // after it
  EXPECT_EQ(pose.newest()->translation.x(), 3);
}

// Such as a flipped bit makes. An ECM that was homed anew stays where it seems wild.
TEST_F(ArmPoseTest, AWildOneDoesNotCountAndThreeThatAgreeDo) {
  const ArmPose pose(transport_, "ECM", clock_);
  const Rigid3 turned{rotation_by({0, 0, 0.3}), {0, 0, 0}};
  for (int k = 0; k < 20; ++k) {
    say("/ECM/local/measured_cp", 1 + 0.01 * k, k == 10 ? at(0.1) : k == 15 ? turned : at(0));
    EXPECT_EQ(pose.newest()->translation.x(), 0) << k;
    EXPECT_LT(pose.newest()->rotation.angularDistance(at(0).rotation), 1e-9) << k;
  }
  for (int k = 0; k < 4; ++k) {
    say("/ECM/local/measured_cp", 1.2 + 0.01 * k, at(0.1));
    EXPECT_EQ(pose.newest()->translation.x(), k < 2 ? 0 : 0.1) << k;
  }
  EXPECT_FALSE(pose.at(1.2)) << "a way from the one place to the other";
}

// A constant twist comes back at every time between the messages and 0.1 s beyond, and nothing farther. The time is the
// fastest message's: 10 ms late.
TEST_F(ArmPoseTest, FollowsAConstantTwist) {
  const ArmPose pose(transport_, "ECM", clock_);
  const auto true_at = [](double time_s) {
    return Rigid3{rotation_by(time_s * Eigen::Vector3d(0.02, -0.03, 0.04)), time_s * Eigen::Vector3d(0.2, 0.1, -0.15)};
  };
  for (int k = 0; k <= 200; ++k) say("/ECM/local/measured_cp", 0.01 * k, true_at(0.01 * k));
  for (double time_s = 0.013; time_s < 2.1; time_s += 0.0123) {
    const auto now = pose.at(time_s + 0.01);
    ASSERT_TRUE(now) << time_s;
    EXPECT_LT((now->translation - true_at(time_s).translation).norm(), 1e-6) << time_s;
    EXPECT_LT(now->rotation.angularDistance(true_at(time_s).rotation), 1e-6) << time_s;
  }
  EXPECT_FALSE(pose.at(-0.1));
  EXPECT_FALSE(pose.at(2.12));
}

// The camera goes as the ECM's tip, whose frame is turned by pi about the view.
TEST_F(ArmPoseTest, TheEndoscopeGoesAsItsArm) {
  const ArmPose arm(transport_, "ECM", clock_);
  HeldEndoscope endoscope(arm);
  EXPECT_FALSE(endoscope.begin());
  const Rigid3 first{Eigen::Quaterniond(0.3, -0.2, 0.9, 0.1).normalized(), {0.1, 0.2, -0.1}};
  say("/ECM/local/measured_cp", 1, first);
  EXPECT_FALSE(endoscope.first_from_camera(1.01));
  ASSERT_TRUE(endoscope.begin());
  const Rigid3 by{rotation_by({0.1, 0, 0.2}), {0.01, 0.02, 0.03}};  // in the camera's own frame
  say("/ECM/local/measured_cp", 1.25, first * dvrk_from_camera() * by * dvrk_from_camera().inverse());
  const auto moved = endoscope.first_from_camera(1.26);
  ASSERT_TRUE(moved);
  EXPECT_LT((moved->translation - by.translation).norm(), 1e-9);
  EXPECT_LT(moved->rotation.angularDistance(by.rotation), 1e-7);
}

}  // namespace lapservo::internal::arm_pose_test
