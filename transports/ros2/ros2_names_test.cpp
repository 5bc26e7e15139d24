#include "transports/ros2/ros2_names.h"

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"

namespace lapservo::internal::ros2_names_test {

TEST(Ros2Names, TopicsAreMangledAsRos2Does) {
  EXPECT_EQ(dds_topic_name("/PSM1/measured_js"), "rt/PSM1/measured_js");
  EXPECT_EQ(dds_topic_name("camera/image_raw"), "rt/camera/image_raw");
  for (const char* wrong : {"", "/", "//a", "/a//b", "/a/", "/1a", "/a b", "/a\nb", "/a-b", "rt/<x>"})
    EXPECT_NE(testing::input_error([&] { dds_topic_name(wrong); }), "") << wrong;
}

TEST(Ros2Names, TopicsAndTypesOfOthersAreRos2s) {
  EXPECT_EQ(ros2_topic_name("rt/PSM1/measured_js"), "/PSM1/measured_js");
  for (const char* other : {"rq/add/_request", "ros_discovery_info", "DCPSTopic", ""})
    EXPECT_EQ(ros2_topic_name(other), std::nullopt) << other;
  EXPECT_EQ(ros2_type_name("sensor_msgs::msg::dds_::JointState_"), "sensor_msgs/msg/JointState");
  EXPECT_EQ(ros2_type_name("a::Type"), "a/Type");
}

TEST(Ros2Names, Domains) {
  EXPECT_EQ(domain_id(""), 0u);
  EXPECT_EQ(domain_id("42"), 42u);
  EXPECT_EQ(domain_id("232"), 232u);
  for (const char* wrong : {"233", "-1", "1x", " 1", "99999999999"})
    EXPECT_NE(testing::input_error([&] { domain_id(wrong); }), "") << wrong;
}

}  // namespace lapservo::internal::ros2_names_test
