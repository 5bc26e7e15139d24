#include "lapservo/crtk/arm_pose.h"

#include <limits>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_transport.h"

namespace lapservo::internal {
namespace {

PlaceMessage at(double x) {
  return {1, "", {Eigen::Quaterniond::Identity(), {x, 0, 0}}};
}

TEST(ArmPose, IsTheArmsOwnWhereThereIsOne) {
  TestTransport transport;
  const ArmPose pose(transport, "/dvrk/ECM");
  EXPECT_FALSE(pose.newest());
  transport.say("/dvrk/ECM/measured_cp", at(1));
  EXPECT_EQ(pose.newest()->pose.translation.x(), 1);
  transport.say("/dvrk/ECM/local/measured_cp", at(2));
  transport.say("/dvrk/ECM/measured_cp", at(3));
  EXPECT_EQ(pose.newest()->pose.translation.x(), 2);
}

TEST(ArmPose, OneThatIsNoneDoesNotCount) {
  TestTransport transport;
  const ArmPose pose(transport, "ECM");
  transport.say("/ECM/measured_cp", at(std::numeric_limits<double>::quiet_NaN()));
  transport.say("/ECM/measured_cp", PlaceMessage{1, "", {Eigen::Quaterniond(0, 0, 0, 0), {1, 0, 0}}});
  EXPECT_FALSE(pose.newest());
}

}  // namespace
}  // namespace lapservo::internal
