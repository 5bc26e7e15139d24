#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_inbox.h"
#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

// A message as it was sent, the stamp to the microsecond.

inline void expect_same(const JointMessage& heard, const JointMessage& sent) {
  EXPECT_NEAR(heard.stamp_s, sent.stamp_s, 1e-6);
  EXPECT_EQ(heard.names, sent.names);
  EXPECT_EQ(heard.positions, sent.positions);
}
inline void expect_same(const OperatingStateMessage& heard, const OperatingStateMessage& sent) {
  EXPECT_NEAR(heard.stamp_s, sent.stamp_s, 1e-6);
  EXPECT_EQ(heard.state, sent.state);
  EXPECT_EQ(heard.is_homed, sent.is_homed);
  EXPECT_EQ(heard.is_busy, sent.is_busy);
}
inline void expect_same(const StringMessage& heard, const StringMessage& sent) {
  EXPECT_NEAR(heard.stamp_s, sent.stamp_s, 1e-6);
  EXPECT_EQ(heard.text, sent.text);
}
inline void expect_same(const JoyMessage& heard, const JoyMessage& sent) {
  EXPECT_NEAR(heard.stamp_s, sent.stamp_s, 1e-6);
  EXPECT_EQ(heard.buttons, sent.buttons);
}
inline void expect_same(const BoolMessage& heard, const BoolMessage& sent) {
  EXPECT_EQ(heard.value, sent.value);
}
inline void expect_same(const TrajectoryMessage& heard, const TrajectoryMessage& sent) {
  EXPECT_NEAR(heard.stamp_s, sent.stamp_s, 1e-6);
  EXPECT_EQ(heard.names, sent.names);
  ASSERT_EQ(heard.points.size(), sent.points.size());
  for (std::size_t i = 0; i < sent.points.size(); ++i) {
    EXPECT_EQ(heard.points[i].time_s, sent.points[i].time_s);
    EXPECT_EQ(heard.points[i].positions, sent.points[i].positions);
  }
}
inline void expect_same(const ImageMessage& heard, const ImageMessage& sent) {
  EXPECT_NEAR(heard.stamp_s, sent.stamp_s, 1e-6);
  EXPECT_EQ(heard.width, sent.width);
  EXPECT_EQ(heard.height, sent.height);
  EXPECT_EQ(heard.step, sent.step);
  EXPECT_EQ(heard.encoding, sent.encoding);
  EXPECT_EQ(heard.is_bigendian, sent.is_bigendian);
  EXPECT_EQ(heard.data, sent.data);
}
inline void expect_same(const CompressedImageMessage& heard, const CompressedImageMessage& sent) {
  EXPECT_NEAR(heard.stamp_s, sent.stamp_s, 1e-6);
  EXPECT_EQ(heard.format, sent.format);
  EXPECT_EQ(heard.data, sent.data);
}

constexpr double sample_stamp_s = 1700000000.123456;
const JointMessage sample_joints{sample_stamp_s, {"yaw", "", "pitch"}, {0.25, 0, -1.5}};
const OperatingStateMessage sample_state{sample_stamp_s, "ENABLED", true, false};
const StringMessage sample_string{sample_stamp_s, "enable"};
const JoyMessage sample_joy{sample_stamp_s, {1, 0, -3}};
const TrajectoryMessage sample_trajectory{sample_stamp_s, {"s_rad"}, {{0, {1}}, {2.25, {3, 4}}}};
const ImageMessage sample_image{sample_stamp_s, 2, 1, 6, "bgr8", true, {1, 2, 3, 4, 5, 6}};
const CompressedImageMessage sample_jpeg{sample_stamp_s, "jpeg", {7, 8}};

/// Messages that `from` sends on the topic `in` + KIND arrive at `to` on `out` + KIND, for each kind but the operating
/// state.
inline void expect_carries_each_kind(Transport& from, const std::string& in, Transport& to, const std::string& out) {
  const auto carry_as = [&]<typename Message>(const std::string& kind, auto publisher, auto subscribe, const auto& sent,
                                              const Message& heard) {
    TestInbox<Message> inbox;
    const auto subscription = (to.*subscribe)(out + kind, inbox.handler());
    const auto say = (from.*publisher)(in + kind);
    expect_same(inbox.get([&] { say(sent); }), heard);
  };
  const auto carry = [&](const std::string& kind, auto publisher, auto subscribe, const auto& sent) {
    carry_as(kind, publisher, subscribe, sent, sent);
  };
  carry("joints", &Transport::joint_publisher, &Transport::subscribe_joints, sample_joints);
  carry("text", &Transport::string_publisher, &Transport::subscribe_strings, sample_string);
  carry_as("joy", &Transport::joy_publisher, &Transport::subscribe_buttons, sample_joy, BoolMessage{true});
  carry("bool", &Transport::bool_publisher, &Transport::subscribe_buttons, BoolMessage{true});
  carry("trajectory", &Transport::trajectory_publisher, &Transport::subscribe_trajectories, sample_trajectory);
  carry("compressed", &Transport::compressed_image_publisher, &Transport::subscribe_compressed_images, sample_jpeg);
  ImageMessage large{sample_stamp_s, 640, 360, 1920, "bgr8", true, {}};
  for (unsigned i = 0; i < 1920 * 360; ++i) large.data.push_back(static_cast<std::uint8_t>(i * i));
  carry("image", &Transport::image_publisher, &Transport::subscribe_images, large);
}

}  // namespace lapservo::internal
