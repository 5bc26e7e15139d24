#include "recordings/bag_topics.h"

#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/testing/input_error.h"

namespace lapservo::internal::bag_topics_test {

class ListedBag : public Bag {
 public:
  explicit ListedBag(std::vector<BagTopic> topics) : Bag("run.bag") { topics_ = std::move(topics); }
  std::unique_ptr<BagMessages> messages(const BagTopic&) const override { throw std::logic_error("not requested"); }
};

std::string image_topic(const std::vector<BagTopic>& topics, const std::string& name = "") {
  return image_topic_of(ListedBag(topics), name).name;
}
std::string image_error(const std::vector<BagTopic>& topics, const std::string& name = "") {
  return testing::input_error([&] { image_topic(topics, name); });
}
std::string joint_topic(const std::vector<BagTopic>& topics, const std::string& name = "") {
  const ListedBag bag(topics);
  const BagTopic* topic = joint_topic_of(bag, name, "PSM1", {"PSM3"});
  return topic ? topic->name : "none";
}

const BagTopic left{"/left", image_type, 9, 1}, right{"/right", compressed_image_type, 9, 1},
    left_jpeg{"/left/compressed", compressed_image_type, 9, 1}, silent{"/silent", image_type, 0, 0},
    tf{"/tf", "tf2_msgs/TFMessage", 3, 1};
const BagTopic psm1{"/PSM1/measured_js", joint_type, 9, 1}, psm2{"/PSM2/measured_js", joint_type, 9, 1},
    jaw{"/PSM2/jaw/measured_js", joint_type, 9, 1}, psm3{"/PSM3/measured_js", joint_type, 9, 1},
    set_points{"/PSM1/setpoint_js", joint_type, 9, 1}, ecm{"/ECM/setpoint_js", joint_type, 9, 1};

TEST(BagTopics, TheOnlyImages) {
  EXPECT_EQ(image_topic({tf, psm1, left, silent}), "/left");
  EXPECT_EQ(image_topic({right}), "/right");
  EXPECT_EQ(image_topic({left, left_jpeg}), "/left");
  EXPECT_EQ(image_topic({left_jpeg, left}), "/left");
  EXPECT_EQ(image_topic({left, right}, "/right"), "/right");
}

TEST(BagTopics, WithoutAChoiceItIsSaidWhatThereIs) {
  EXPECT_EQ(image_error({left, right, tf}),
            "run.bag: has several topics of images, expected one to be named with --image-topic: it holds /left "
            "(sensor_msgs/Image, 9), /right (sensor_msgs/CompressedImage, 9), /tf (tf2_msgs/TFMessage, 3)");
  EXPECT_EQ(
      image_error({tf}),
      "run.bag: has no images, expected a topic of sensor_msgs/Image or sensor_msgs/CompressedImage: it holds /tf "
      "(tf2_msgs/TFMessage, 3)");
  EXPECT_NE(image_error({}).find("it holds nothing"), std::string::npos);
  for (const char* name : {"/tf", "/silent", "/nobody"})
    EXPECT_NE(image_error({left, tf, silent}, name).find("--image-topic: is " + std::string(name)), std::string::npos);
}

TEST(BagTopics, TheArmsMeasuredJoints) {
  EXPECT_EQ(joint_topic({psm1, psm2, set_points, left}), "/PSM1/measured_js");
  EXPECT_EQ(joint_topic({psm2, set_points}), "/PSM2/measured_js");  // the only one
  EXPECT_EQ(joint_topic({ecm, tf}), "/ECM/setpoint_js");
  EXPECT_EQ(joint_topic({psm2, jaw}), "/PSM2/measured_js");
  EXPECT_EQ(joint_topic({left}), "none");
  EXPECT_EQ(joint_topic({psm1, psm2}, "/PSM2/measured_js"), "/PSM2/measured_js");
  EXPECT_NE(testing::input_error([] { joint_topic({set_points, ecm}); }).find("--joint-topic"), std::string::npos);
  EXPECT_EQ(testing::input_error([] { joint_topic({psm3}); }),
            "run.bag: has no topic of joints of PSM1, expected one to be named with --joint-topic: it holds "
            "/PSM3/measured_js (sensor_msgs/JointState, 9)");
  const std::string no_joints = testing::input_error([] { joint_topic({psm1, left}, "/left"); });
  EXPECT_NE(no_joints.find("--joint-topic: is /left"), std::string::npos);
}

}  // namespace lapservo::internal::bag_topics_test
