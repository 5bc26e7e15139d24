#include "transports/ros1/ros1_decoder.h"

#include <cmath>
#include <ros/serialization.h>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_messages.h"
#include "transports/ros1/ros1_messages.h"

namespace lapservo::internal::ros1_decoder_test {

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
  expect_read_whole_and_nothing_else(sample_words);
  expect_read_whole_and_nothing_else(sample_trajectory);
  expect_read_whole_and_nothing_else(sample_place);
  expect_read_whole_and_nothing_else(sample_joy);
  expect_read_whole_and_nothing_else(BoolMessage{true});
  expect_read_whole_and_nothing_else(sample_image);
  expect_read_whole_and_nothing_else(sample_jpeg);
  const auto nan = decode_ros1<JointMessage>(bytes_of(ros1_message(JointMessage{stamp_s, {"yaw"}, {NAN}})));
  EXPECT_TRUE(std::isnan(nan.value().positions[0]));
}

TEST(Ros1Decoder, SkipsWhatItDoesNotUse) {
  Ros1Type<JointMessage> wire;
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
  Ros1Type<JointMessage> wire;
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
  EXPECT_STREQ(md5sum<Ros1Type<OperatingStateMessage>>(), "b1bd4021639d9d9c5fbfff78d6ff3158");
  EXPECT_STREQ(md5sum<Ros1Type<StringMessage>>(), "5e3e46086181199270f1ac3a28a5977f");
  EXPECT_STREQ(datatype<Ros1Type<OperatingStateMessage>>(), "crtk_msgs/OperatingState");
  EXPECT_STREQ(datatype<Ros1Type<ObservationMessage>>(), "lapservo_msgs/Observation");
  for (const std::string definition :
       {definition<Ros1Type<OperatingStateMessage>>(), definition<Ros1Type<ObservationMessage>>()}) {
    EXPECT_NE(definition.find("MSG: std_msgs/Header\n"), std::string::npos) << definition;
    EXPECT_NE(definition.find("uint32 seq\n"), std::string::npos) << definition;
  }
}

TEST(Ros1Messages, TellOfTheLoop) {
  constexpr std::uint32_t second = 1700000000;
  const Rigid3 place{Eigen::Quaterniond(0.8, 0, 0.6, 0), {1, 2, 3}};
  const auto frames_wire = ros1_message(TransformsMessage{stamp_s, {{"a", "b", {}}, {"c", "d", place}}});
  ASSERT_EQ(frames_wire.transforms.size(), 2u);
  const auto& frame = frames_wire.transforms[1];
  EXPECT_EQ(std::tuple(frame.header.stamp.sec, frame.header.frame_id, frame.child_frame_id, frame.transform.rotation.w),
            std::tuple(second, "c", "d", 0.8));
  const auto band_wire =
      ros1_message(CylindersMessage{stamp_s, "endoscope", "PSM1", {{}, {place, 0.5, 0.25, {1, 0.5, 0.25, 0.125}}}});
  const auto& band = band_wire.markers.at(1);
  EXPECT_EQ(std::tuple(band.ns, band.id, band.type, band.scale.x, band.scale.z, band.color.a, band.lifetime.toSec()),
            std::tuple("PSM1", 1, 3, 0.5, 0.25, 0.125f, 0.5));
  // ros/common_msgs' and ros/geometry2's own.
  EXPECT_STREQ(ros::message_traits::md5sum<Ros1Type<CylindersMessage>>(), "d155b9ce5188fbaf89745847fd5882d7");
  EXPECT_STREQ(ros::message_traits::md5sum<Ros1Type<TransformsMessage>>(), "94810edda583a504dfda3829e70d7eec");

  const CameraInfoMessage camera{stamp_s, 640, 360, {1, 2, 3, 4, 5}, {550, 0, 319.5, 0, 551, 179.5, 0, 0, 1}, "e"};
  const auto camera_wire = ros1_message(camera);
  EXPECT_EQ(
      std::tuple(camera_wire.header.frame_id, camera_wire.distortion_model, camera_wire.D.at(4), camera_wire.K[4]),
      std::tuple("e", "plumb_bob", 5, 551));
  const std::array<double, 12> p{550, 0, 319.5, 0, 0, 551, 179.5, 0, 0, 0, 1, 0};
  for (std::size_t i = 0; i < p.size(); ++i) EXPECT_EQ(camera_wire.P[i], p[i]) << i;
}

}  // namespace lapservo::internal::ros1_decoder_test
