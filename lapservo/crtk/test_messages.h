#pragma once

#include <cstdint>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_inbox.h"
#include "lapservo/crtk/transport.h"

namespace lapservo::internal {

// All of a message but its stamp.
struct Fields {
  static auto of(const JointMessage& m) { return std::tie(m.names, m.positions); }
  static auto of(const OperatingStateMessage& m) { return std::tie(m.state, m.is_homed, m.is_busy); }
  static auto of(const StringMessage& m) { return std::tie(m.text); }
  static auto of(const TextMessage& m) { return std::tie(m.text); }
  static auto of(const JoyMessage& m) { return std::tie(m.buttons); }
  static auto of(const BoolMessage& m) { return std::tie(m.value); }
  static auto of(const TrajectoryMessage& m) {
    std::vector<std::pair<double, std::vector<double>>> points;
    for (const auto& point : m.points) points.emplace_back(point.time_s, point.positions);
    return std::tuple(m.names, points, m.frame);
  }
  static auto of(const ImageMessage& m) {
    return std::tie(m.width, m.height, m.step, m.encoding, m.is_bigendian, m.data);
  }
  static auto of(const PlaceMessage& m) { return std::tie(m.pose, m.frame); }
  static auto of(const CompressedImageMessage& m) { return std::tie(m.format, m.data); }
};

/// A message as it was sent, the stamp to the microsecond.
template <typename Message>
void expect_same(const Message& heard, const Message& sent) {
  if constexpr (requires { heard.stamp_s; }) {
    EXPECT_NEAR(heard.stamp_s, sent.stamp_s, 1e-6);
  }
  EXPECT_EQ(Fields::of(heard), Fields::of(sent));
}

constexpr double sample_stamp_s = 1700000000.123456;
const JointMessage sample_joints{sample_stamp_s, {"yaw", "", "pitch"}, {0.25, 0, -1.5}};
const OperatingStateMessage sample_state{sample_stamp_s, "ENABLED", true, false};
const StringMessage sample_string{sample_stamp_s, "enable"};
const TextMessage sample_words{"PSM1: power loss"};
const JoyMessage sample_joy{sample_stamp_s, {1, 0, -3}};
const TrajectoryMessage sample_trajectory{sample_stamp_s, {"s_rad"},  {{0, {1}}, {2.25, {3, 4}}}, 0,
                                          Latched::no,    "endoscope"};
const ImageMessage sample_image{sample_stamp_s, 2, 1, 6, "bgr8", true, {1, 2, 3, 4, 5, 6}};
const PlaceMessage sample_place{sample_stamp_s, "Cart", {Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {1, -2, 3}}};
const CompressedImageMessage sample_jpeg{sample_stamp_s, "jpeg", {7, 8}};

/// Messages that `from` sends on the topic `in` + KIND arrive at `to` on `out` + KIND, with their sender, for each kind
/// but the operating state.
inline void expect_carries_each_kind(Transport& from, const std::string& in, Transport& to, const std::string& out) {
  const auto carry_as = [&]<typename Sent, typename Message>(const std::string& kind, const Sent& sent,
                                                             const Message& heard) {
    TestInbox<Message> inbox;
    const auto subscription = to.subscribe<Message>(out + kind, inbox.handler());
    const auto say = from.publisher<Sent>(in + kind);
    const Message one = inbox.get([&] { say(sent); });
    expect_same(one, heard);
    if constexpr (requires { one.source; }) {
      EXPECT_NE(one.source, 0u) << "nobody sent " << kind;
    }
  };
  const auto carry = [&](const std::string& kind, const auto& sent) { carry_as(kind, sent, sent); };
  carry("joints", sample_joints);
  carry("text", sample_string);
  carry("words", sample_words);
  carry_as("joy", sample_joy, BoolMessage{true});
  carry("bool", BoolMessage{true});
  carry("trajectory", sample_trajectory);
  carry("compressed", sample_jpeg);
  carry("place", sample_place);
  ImageMessage large{sample_stamp_s, 640, 360, 1920, "bgr8", true, {}};
  for (unsigned i = 0; i < 1920 * 360; ++i) large.data.push_back(static_cast<std::uint8_t>(i * i));
  carry("image", large);
}

}  // namespace lapservo::internal
