#include "transports/ros1/ros1_decoder.h"

#include <cmath>
#include <ros/serialization.h>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_messages.h"
#include "transports/ros1/ros1_messages.h"

namespace lapservo::internal {
namespace {

constexpr double stamp_s = sample_stamp_s;

// As ROS itself writes it.
template <typename Type>
std::vector<std::uint8_t> bytes_of(const Type& wire) {
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(wire));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, wire);
  return bytes;
}

template <typename Message>
void expect_read_whole_and_nothing_else(const Message& message) {
  std::vector<std::uint8_t> bytes = bytes_of(ros1_message(message));
  const auto decoded = decode_ros1<Message>(bytes);
  ASSERT_TRUE(decoded);
  expect_same(*decoded, message);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(decode_ros1<Message>(std::span(bytes).first(size))) << size;
  bytes.push_back(0);
  EXPECT_FALSE(decode_ros1<Message>(bytes));
}

TEST(Ros1Decoder, ReadsWhatRosWritesAndRefusesWhatIsCutShortOrLeftOver) {
  expect_read_whole_and_nothing_else(sample_joints);
  expect_read_whole_and_nothing_else(sample_state);
  expect_read_whole_and_nothing_else(sample_string);
  expect_read_whole_and_nothing_else(sample_trajectory);
  expect_read_whole_and_nothing_else(sample_joy);
  expect_read_whole_and_nothing_else(BoolMessage{true});
  expect_read_whole_and_nothing_else(sample_image);
  expect_read_whole_and_nothing_else(sample_jpeg);
  const auto nan = decode_ros1<JointMessage>(bytes_of(ros1_message(JointMessage{stamp_s, {"yaw"}, {NAN}})));
  EXPECT_TRUE(std::isnan(nan.value().positions[0]));
}

TEST(Ros1Decoder, SkipsWhatItDoesNotUse) {
  ros1::JointState wire;
  wire.header.seq = 7;
  wire.header.frame_id = "base";
  wire.name = {"yaw"};
  wire.position = {1};
  wire.velocity = {2};
  wire.effort = {3, 4};
  const auto joints = decode_ros1<JointMessage>(bytes_of(wire));
  ASSERT_TRUE(joints);
  EXPECT_EQ(joints->positions, std::vector<double>{1});
}

TEST(Ros1Decoder, AStampThatIsNoneIsNotANumber) {
  ros1::JointState wire;
  wire.header.stamp.sec = 5;
  wire.header.stamp.nsec = 1000000000u;
  EXPECT_TRUE(std::isnan(decode_ros1<JointMessage>(bytes_of(wire))->stamp_s));
  wire.header.stamp.nsec = 999999999u;
  EXPECT_NEAR(decode_ros1<JointMessage>(bytes_of(wire))->stamp_s, 6, 1e-8);
  EXPECT_EQ(decode_ros1<JointMessage>(bytes_of(ros1_message(JointMessage{NAN, {}, {}})))->stamp_s, 0);
}

// As in collaborative-robotics/crtk_msgs for ROS 1, so that its nodes take ours for theirs.
TEST(Ros1Messages, CarryTheTypesSums) {
  using namespace ros::message_traits;
  EXPECT_STREQ(md5sum<ros1::OperatingState>(), "b1bd4021639d9d9c5fbfff78d6ff3158");
  EXPECT_STREQ(md5sum<ros1::StringStamped>(), "5e3e46086181199270f1ac3a28a5977f");
  EXPECT_STREQ(datatype<ros1::OperatingState>(), "crtk_msgs/OperatingState");
  EXPECT_STREQ(datatype<ros1::Observation>(), "lapservo_msgs/Observation");
  for (const std::string definition : {definition<ros1::OperatingState>(), definition<ros1::Observation>()}) {
    EXPECT_NE(definition.find("MSG: std_msgs/Header\n"), std::string::npos) << definition;
    EXPECT_NE(definition.find("uint32 seq\n"), std::string::npos) << definition;
  }
}

TEST(Ros1Messages, TellOfTheLoop) {
  PoseMessage pose{stamp_s, "endoscope", {1, 2, 3}, {0, 0.6, 0, 0.8}, {}};
  pose.covariance[7] = 5;
  const auto pose_wire = ros1_message(pose);
  EXPECT_EQ(pose_wire.header.stamp.sec, 1700000000u);
  EXPECT_EQ(pose_wire.header.frame_id, "endoscope");
  EXPECT_EQ(pose_wire.pose.pose.position.z, 3);
  EXPECT_EQ(pose_wire.pose.pose.orientation.w, 0.8);
  EXPECT_EQ(pose_wire.pose.covariance[7], 5);

  const Rigid3 place{Eigen::Quaterniond(0.8, 0, 0.6, 0), {1, 2, 3}};
  const auto place_wire = ros1_message(PlaceMessage{stamp_s, "camera", place});
  EXPECT_EQ(place_wire.header.frame_id, "camera");
  EXPECT_EQ(place_wire.pose.position.z, 3);
  EXPECT_EQ(place_wire.pose.orientation.y, 0.6);
  const auto frames_wire = ros1_message(TransformsMessage{stamp_s, {{"a", "b", {}}, {"c", "d", place}}});
  ASSERT_EQ(frames_wire.transforms.size(), 2u);
  EXPECT_EQ(frames_wire.transforms[1].header.stamp.sec, 1700000000u);
  EXPECT_EQ(frames_wire.transforms[1].header.frame_id, "c");
  EXPECT_EQ(frames_wire.transforms[1].child_frame_id, "d");
  EXPECT_EQ(frames_wire.transforms[1].transform.rotation.w, 0.8);
  const auto band_wire =
      ros1_message(CylindersMessage{stamp_s, "endoscope", "PSM1", {{}, {place, 0.5, 0.25, {1, 0.5, 0.25, 0.125}}}});
  const auto& band = band_wire.markers.at(1);
  EXPECT_EQ(band.ns, "PSM1");
  EXPECT_EQ(band.id, 1);
  EXPECT_EQ(band.type, 3);
  EXPECT_EQ(band.scale.x, 0.5);
  EXPECT_EQ(band.scale.z, 0.25);
  EXPECT_EQ(band.color.a, 0.125f);
  EXPECT_EQ(band.lifetime.toSec(), 0.5);
  // ros/common_msgs' and ros/geometry2's own.
  EXPECT_STREQ(ros::message_traits::md5sum<ros1::MarkerArray>(), "d155b9ce5188fbaf89745847fd5882d7");
  EXPECT_STREQ(ros::message_traits::md5sum<ros1::TFMessage>(), "94810edda583a504dfda3829e70d7eec");

  const DiagnosticMessage state{
      stamp_s, DiagnosticMessage::Level::warning, "lapservo", "hold", {{"reason", "outlier"}}};
  const auto state_wire = ros1_message(state);
  ASSERT_EQ(state_wire.status.size(), 1u);
  EXPECT_EQ(state_wire.status[0].level, 1);
  EXPECT_EQ(state_wire.status[0].values.at(0).value, "outlier");

  ObservationMessage seen;
  seen.status = "ok";
  seen.q = {1, 2, 3, 4};
  seen.feature_covariance[15] = 6;
  seen.error[3] = 7;
  const auto seen_wire = ros1_message(seen);
  EXPECT_EQ(seen_wire.status, "ok");
  EXPECT_EQ(seen_wire.q[3], 4);
  EXPECT_EQ(seen_wire.feature_covariance[15], 6);
  EXPECT_EQ(seen_wire.error[3], 7);

  const CameraInfoMessage camera{stamp_s, 640, 360, {1, 2, 3, 4, 5}, {550, 0, 319.5, 0, 551, 179.5, 0, 0, 1}, "e"};
  const auto camera_wire = ros1_message(camera);
  EXPECT_EQ(camera_wire.header.frame_id, "e");
  EXPECT_EQ(camera_wire.distortion_model, "plumb_bob");
  EXPECT_EQ(camera_wire.D.at(4), 5);
  EXPECT_EQ(camera_wire.K[4], 551);
  const std::array<double, 12> p{550, 0, 319.5, 0, 0, 551, 179.5, 0, 0, 0, 1, 0};
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_EQ(camera_wire.P[i], p[i]) << i;
}

}  // namespace
}  // namespace lapservo::internal
