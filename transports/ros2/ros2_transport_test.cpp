#include "transports/ros2/ros2_transport.h"

#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_inbox.h"
#include "lapservo/crtk/test_messages.h"
#include "lapservo/testing/wait_for.h"
#include "transports/ros2/dds_node.h"
#include "transports/ros2/ros2_names.h"
#include "transports/ros2/wire.h"

namespace lapservo::internal {
namespace {

constexpr std::chrono::seconds patience(60);

constexpr double stamp_s = sample_stamp_s;

TEST(Ros2Transport, CarriesEveryKindOfMessage) {
  Ros2Transport from("from"), to("to");
  TestInbox<OperatingStateMessage> states;
  const auto say_state = from.operating_state_publisher("PSM1/operating_state");
  say_state(sample_state);  // before anybody listens: it is latched
  const auto subscription = to.subscribe_operating_state("/PSM1/operating_state", states.handler());
  expect_same(states.get([] {}), sample_state);
  expect_carries_each_kind(from, "/PSM1/", to, "/PSM1/");
}

TEST(Ros2Transport, ListsWhatOthersPublish) {
  Ros2Transport one("one"), other("other");
  const auto joints = one.joint_publisher("/PSM1/measured_js");
  const auto images = other.image_publisher("endoscope/image_raw");
  testing::wait_for([&] { return one.published().contains("/endoscope/image_raw"); });
  const auto published = one.published();
  EXPECT_EQ(published.at("/endoscope/image_raw"), "sensor_msgs/msg/Image");
  EXPECT_FALSE(published.contains("/PSM1/measured_js")) << "its own";
}

TEST(Ros2Transport, DoesNotHearItself) {
  Ros2Transport one("one"), other("other");
  TestInbox<JointMessage> own, others;
  const auto own_subscription = one.subscribe_joints("/PSM1/servo_jp", own.handler());
  const auto others_subscription = other.subscribe_joints("/PSM1/servo_jp", others.handler());
  const auto say = one.joint_publisher("/PSM1/servo_jp");
  others.get([&] { say({stamp_s, {}, {1}}); });
  EXPECT_TRUE(own.empty());
}

// Each reliability and durability that a publisher may offer is heard, once.
TEST(Ros2Transport, EveryPublisherOfOperatingStatesMatches) {
  for (const Delivery delivery : {Delivery::reliable, Delivery::best_effort, Delivery::latched}) {
    Ros2Transport to("to");
    const char* const domain = std::getenv("ROS_DOMAIN_ID");
    DdsNode from("from", domain_id(domain ? domain : ""));
    TestInbox<OperatingStateMessage> states;
    const auto subscription = to.subscribe_operating_state("/PSM1/operating_state", states.handler());
    const dds_entity_t writer =
        from.create_writer("/PSM1/operating_state", Wire<OperatingStateMessage>::descriptor(), delivery);
    const auto state = states.get([&] {
      Wire<OperatingStateMessage>::write(writer, {stamp_s, "PAUSED", true, false});
    });
    EXPECT_EQ(state.state, "PAUSED") << static_cast<int>(delivery);
  }
}

// The first message of a topic as its type lies in memory, said again until it is there.
template <typename Message>
void expect_heard(const std::function<void()>& say, const std::string& topic,
                  const std::function<void(const typename Wire<Message>::Type&)>& look) {
  const char* const domain = std::getenv("ROS_DOMAIN_ID");
  DdsNode to("to", domain_id(domain ? domain : ""));
  const dds_entity_t reader = to.create_reader(topic, Wire<Message>::descriptor(), Delivery::reliable);
  void* sample = nullptr;
  dds_sample_info_t info;
  const auto end = std::chrono::steady_clock::now() + patience;
  while (dds_take(reader, &sample, &info, 1, 1) <= 0) {
    ASSERT_LT(std::chrono::steady_clock::now(), end);
    say();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  look(*static_cast<const typename Wire<Message>::Type*>(sample));
  dds_return_loan(reader, &sample, 1);
}

TEST(Ros2Transport, WhatItTellsOfTheLoopReadsBack) {
  Ros2Transport from("from");
  PoseMessage pose{stamp_s, "endoscope", {1, 2, 3}, {0, 0.6, 0, 0.8}, {}};
  pose.covariance[7] = 5;
  const auto say_pose = from.pose_publisher("/pose");
  expect_heard<PoseMessage>([&] { say_pose(pose); }, "/pose",
                            [](const auto& wire) {
                              EXPECT_EQ(wire.header_.stamp_.sec_, 1700000000);
                              EXPECT_STREQ(wire.header_.frame_id_, "endoscope");
                              EXPECT_EQ(wire.pose_.pose_.position_.z_, 3);
                              EXPECT_EQ(wire.pose_.pose_.orientation_.w_, 0.8);
                              EXPECT_EQ(wire.pose_.covariance_[7], 5);
                            });
  const auto say_state = from.diagnostic_publisher("/diagnostics");
  const DiagnosticMessage state{
      stamp_s, DiagnosticMessage::Level::warning, "lapservo", "hold", {{"reason", "outlier"}}};
  expect_heard<DiagnosticMessage>([&] { say_state(state); }, "/diagnostics",
                                  [](const auto& wire) {
                                    ASSERT_EQ(wire.status_._length, 1u);
                                    EXPECT_EQ(wire.status_._buffer[0].level_, 1);
                                    EXPECT_STREQ(wire.status_._buffer[0].values_._buffer[0].value_, "outlier");
                                  });
  ObservationMessage seen;
  seen.status = "ok";
  seen.q = {1, 2, 3, 4};
  seen.feature_covariance[15] = 6;
  seen.error[3] = 7;
  const auto say_seen = from.observation_publisher("/seen");
  expect_heard<ObservationMessage>([&] { say_seen(seen); }, "/seen",
                                   [](const auto& wire) {
                                     EXPECT_STREQ(wire.status_, "ok");
                                     EXPECT_EQ(wire.q_[3], 4);
                                     EXPECT_EQ(wire.feature_covariance_[15], 6);
                                     EXPECT_EQ(wire.error_[3], 7);
                                   });
  const auto say_info = from.camera_info_publisher("/camera_info");
  const CameraInfoMessage camera{stamp_s, 640, 360, {1, 2, 3, 4, 5}, {550, 0, 319.5, 0, 551, 179.5, 0, 0, 1}};
  expect_heard<CameraInfoMessage>([&] { say_info(camera); }, "/camera_info",
                                  [](const auto& wire) {
                                    EXPECT_STREQ(wire.distortion_model_, "plumb_bob");
                                    EXPECT_EQ(wire.d_._buffer[4], 5);
                                    EXPECT_EQ(wire.k_[4], 551);
                                    const std::array<double, 12> p{550, 0, 319.5, 0, 0, 551, 179.5, 0, 0, 0, 1, 0};
                                    for (std::size_t i = 0; i < p.size(); ++i) EXPECT_EQ(wire.p_[i], p[i]) << i;
                                  });
}

TEST(Ros2Transport, AStampThatIsNoneIsNotANumber) {
  sensor_msgs_msg_dds__JointState_ wire{};
  wire.header_.stamp_ = {5, 1000000000u};
  EXPECT_TRUE(std::isnan(Wire<JointMessage>::read(wire).stamp_s));
  wire.header_.stamp_ = {5, 999999999u};
  EXPECT_NEAR(Wire<JointMessage>::read(wire).stamp_s, 6, 1e-8);
}

}  // namespace
}  // namespace lapservo::internal
