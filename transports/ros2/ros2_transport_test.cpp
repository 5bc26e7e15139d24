#include "transports/ros2/ros2_transport.h"

#include <chrono>
#include <cmath>
#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_inbox.h"
#include "lapservo/crtk/test_messages.h"
#include "lapservo/testing/wait_for.h"
#include "ros2_messages.h"
#include "transports/ros2/dds_node.h"
#include "transports/ros2/test_dds_peer.h"
#include "transports/ros2/wire.h"

namespace lapservo::internal::ros2_transport_test {

constexpr double stamp_s = sample_stamp_s;

TEST(Ros2Transport, CarriesEveryKindOfMessage) {
  Ros2Transport from("from"), to("to");
  TestInbox<OperatingStateMessage> states;
  const auto say_state = from.publisher<OperatingStateMessage>("PSM1/operating_state");
  say_state(sample_state);  // before anybody listens: it is latched
  const auto subscription = to.subscribe<OperatingStateMessage>("/PSM1/operating_state", states.handler());
  expect_same(states.get([] {}), sample_state);
  expect_carries_each_kind(from, "/PSM1/", to, "/PSM1/");
}

// Each by its name, whatever it has of readers; a program that is no node by its participant's GUID.
TEST(Ros2Transport, KnowsWhoReads) {
  using Names = std::set<std::string>;
  Ros2Transport own("own");
  const auto says = own.set_point_publisher("/PSM1/servo_jp"),
             elsewhere = own.publisher<JointMessage>("/PSM2/servo_jp");
  const auto subscription = own.subscribe<JointMessage>("/PSM1/servo_jp", [](JointMessage&&) {});
  EXPECT_EQ(own.readers("/PSM1/servo_jp"), Names());
  const auto become = [&](const Names& names) {
    return testing::wait_for([&] { return own.readers("/PSM1/servo_jp") == names; });
  };
  auto arm = std::make_unique<Ros2Transport>("arm");
  const auto subscribe = [](Ros2Transport& to) { return to.subscribe<JointMessage>("PSM1/servo_jp", [](auto&&) {}); };
  auto first = subscribe(*arm), second = subscribe(*arm);
  EXPECT_TRUE(become({"/arm"}));
  const auto restarted = std::make_unique<Ros2Transport>("arm");
  const auto third = subscribe(*restarted);
  const auto recorder = node_elsewhere();
  const dds_entity_t reader =
      recorder->create_reader("/PSM1/servo_jp", Wire<JointMessage>::descriptor(), Delivery::reliable);
  EXPECT_TRUE(become({"/arm", "/elsewhere"}));
  recorder->remove(reader);
  EXPECT_TRUE(become({"/arm"}));
  const dds_entity_t topic = dds_create_topic(recorder->participant(), &Wire<JointMessage>::descriptor(),
                                              "rt/PSM1/servo_jp", nullptr, nullptr);
  dds_create_reader(recorder->participant(), topic, nullptr, nullptr);
  EXPECT_TRUE(testing::wait_for([&] { return own.readers("/PSM1/servo_jp").size() == 2; }));
  EXPECT_EQ(own.readers("/PSM1/servo_jp").rbegin()->find_first_not_of("0123456789abcdef"), std::string::npos);
  EXPECT_EQ(own.readers("/PSM2/servo_jp"), Names());
  first = second = nullptr;
}

// So the interlock knows a stranger's state from one of the arm.
TEST(Ros2Transport, ASenderIsAProgramWhicheverTopicItWrites) {
  Ros2Transport to("to"), arm("arm"), other("other");
  TestInbox<JointMessage> joints;
  TestInbox<OperatingStateMessage> states;
  const auto joint_subscription = to.subscribe<JointMessage>("/PSM1/measured_js", joints.handler());
  const auto state_subscription = to.subscribe<OperatingStateMessage>("/PSM1/operating_state", states.handler());
  const auto say_joints = arm.publisher<JointMessage>("/PSM1/measured_js");
  const auto say_state = arm.publisher<OperatingStateMessage>("/PSM1/operating_state");
  const auto say_other = other.publisher<OperatingStateMessage>("/PSM1/operating_state");
  const std::uint64_t source = joints.get([&] { say_joints(sample_joints); }).source;
  EXPECT_EQ(states.get([&] { say_state(sample_state); }).source, source);
  EXPECT_TRUE(testing::wait_for([&] {
    say_other(sample_state);
    return states.all().back().source != source;
  }));
}

// As another program writes them, empty.
TEST(Ros2Transport, HearsCommandsOfEachTypeThatDvrkReads) {
  const std::vector<std::pair<CommandType, const dds_topic_descriptor_t*>> commands{
      {CommandType::joints, &sensor_msgs_msg_dds__JointState__desc},
      {CommandType::joint_servo, &crtk_msgs_msg_dds__JointServo__desc},
      {CommandType::joint_servo, &sensor_msgs_msg_dds__JointState__desc},
      {CommandType::cartesian_state, &crtk_msgs_msg_dds__CartesianServo__desc},
      {CommandType::pose, &geometry_msgs_msg_dds__PoseStamped__desc},
      {CommandType::pose, &geometry_msgs_msg_dds__TransformStamped__desc},
      {CommandType::twist, &geometry_msgs_msg_dds__TwistStamped__desc},
      {CommandType::wrench, &geometry_msgs_msg_dds__WrenchStamped__desc},
      {CommandType::cartesian_state, &crtk_msgs_msg_dds__CartesianState__desc},
      {CommandType::impedance, &crtk_msgs_msg_dds__CartesianImpedance__desc},
      {CommandType::on_or_off, &std_msgs_msg_dds__Bool__desc},
      {CommandType::nothing, &std_msgs_msg_dds__Empty__desc}};
  Ros2Transport loop("loop");
  const auto client = node_elsewhere();
  for (const auto& [type, descriptor] : commands) {
    TestInbox<CommandMessage> heard;
    const auto subscription = loop.subscribe_commands("/PSM1/command", type, heard.handler());
    const dds_entity_t writer = client->create_writer("/PSM1/command", *descriptor, Delivery::reliable);
    const std::vector<std::uint64_t> empty(descriptor->m_size / sizeof(std::uint64_t) + 1);
    heard.get([writer = writer, &empty] { dds_write(writer, empty.data()); });
    client->remove(writer);
  }
}

// A reliable publisher repeats what the network loses; one of best effort is heard as well.
TEST(Ros2Transport, ACommandThatIsSaidOnceIsHeardOnce) {
  Ros2Transport loop("loop");
  const auto client = node_elsewhere();
  for (const Delivery offered : {Delivery::reliable, Delivery::best_effort, Delivery::latched}) {
    TestInbox<CommandMessage> heard;
    const auto subscription = loop.subscribe_commands("/PSM1/move_jp", CommandType::joints, heard.handler());
    const dds_entity_t writer = client->create_writer("/PSM1/move_jp", Wire<JointMessage>::descriptor(), offered);
    wait_for_readers(writer, offered == Delivery::best_effort ? 1 : 2);
    const bool loses = offered == Delivery::reliable;
    dds_domain_set_deafmute(client->participant(), false, loses, DDS_INFINITY);
    Wire<JointMessage>::write(writer, {stamp_s, {}, {1}});
    dds_domain_set_deafmute(client->participant(), false, false, DDS_INFINITY);
    for (int k = 0; k < 200 && heard.empty(); ++k) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_EQ(heard.count(), 1u) << static_cast<int>(offered);
    client->remove(writer);
  }
}

std::vector<double> take_positions(dds_entity_t reader) {
  std::vector<double> taken;
  void* sample = nullptr;
  dds_sample_info_t info;
  while (dds_take(reader, &sample, &info, 1, 1) > 0) {
    if (info.valid_data)
      taken.push_back(Wire<JointMessage>::read(*static_cast<Wire<JointMessage>::Type*>(sample)).positions.at(0));
    dds_return_loan(reader, &sample, 1);
    sample = nullptr;
  }
  return taken;
}

// An arm that hears nothing for a while, as one that was killed, gets none of what was sent meanwhile.
TEST(Ros2Transport, NoSetPointIsDeliveredWhenItIsOld) {
  Ros2Transport from("from");
  const auto arm = node_elsewhere();
  const dds_entity_t reader =
      arm->create_reader("/PSM1/servo_jp", Wire<JointMessage>::descriptor(), Delivery::reliable);
  const auto say = from.set_point_publisher("/PSM1/servo_jp");
  const auto hears = [&](double position) {
    bool heard = false;
    return testing::wait_for([&] {
      say({stamp_s, {}, {position}});
      const auto taken = take_positions(reader);
      return heard = heard || (!taken.empty() && taken.back() == position);
    });
  };
  ASSERT_TRUE(hears(0));
  dds_domain_set_deafmute(arm->participant(), true, false, DDS_INFINITY);
  for (int k = 1; k <= 20; ++k) {
    say({stamp_s, {}, {static_cast<double>(k)}});
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  take_positions(reader);
  dds_domain_set_deafmute(arm->participant(), false, false, DDS_INFINITY);
  std::this_thread::sleep_for(std::chrono::seconds(1));
  EXPECT_EQ(take_positions(reader), std::vector<double>());
  EXPECT_TRUE(hears(99));
}

TEST(Ros2Transport, PeersWhoseQualityOfServiceDoesNotFitAreSaid) {
  ::testing::internal::CaptureStderr();
  Ros2Transport own("own");
  const auto images = own.publisher<ImageMessage>("/endoscope/image_raw");
  const auto joints = own.subscribe<JointMessage>("/PSM1/measured_js", [](JointMessage&&) {});
  DdsNode other("other", test_domain());
  for (int k = 0; k < 2; ++k)
    other.create_reader("/endoscope/image_raw", Wire<ImageMessage>::descriptor(), Delivery::reliable);
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_EQ(
      ::testing::internal::GetCapturedStderr(),
      "DDS: /endoscope/image_raw: a subscriber requires another reliability than is offered, and gets nothing: let "
      "it read best effort\n");
}

TEST(Ros2Transport, AStateThatWasSaidOnceByAVolatilePublisherIsMissed) {
  ::testing::internal::CaptureStderr();
  Ros2Transport to("to");
  DdsNode from("from", test_domain());
  for (const auto& [topic, delivery] : {std::pair("/PSM1/operating_state", Delivery::reliable),
                                        std::pair("/PSM2/operating_state", Delivery::latched)}) {
    const dds_entity_t writer = from.create_writer(topic, Wire<OperatingStateMessage>::descriptor(), delivery);
    Wire<OperatingStateMessage>::write(writer, {stamp_s, "ENABLED", true, false});
  }
  TestInbox<OperatingStateMessage> lost, kept;
  const auto volatile_one = to.subscribe<OperatingStateMessage>("/PSM1/operating_state", lost.handler());
  const auto latched_one = to.subscribe<OperatingStateMessage>("/PSM2/operating_state", kept.handler());
  std::this_thread::sleep_for(std::chrono::seconds(3));
  const std::string said = ::testing::internal::GetCapturedStderr();
  EXPECT_TRUE(lost.empty());
  EXPECT_EQ(kept.count(), 1u);
  EXPECT_NE(said.find("DDS: /PSM1/operating_state: its publisher is volatile and has said nothing since"),
            std::string::npos)
      << said;
  EXPECT_EQ(said.find("PSM2"), std::string::npos) << said;
}

// Each once, and a stop at once, whatever the sender's clock does between two.
TEST(Ros2Transport, CommandsAreHeardWhateverTheSendersClockSays) {
  Ros2Transport to("to");
  DdsNode from("from", test_domain());
  TestInbox<StringMessage> commands;
  const auto subscription = to.subscribe<StringMessage>("/lapservo/PSM1/command", commands.handler());
  const dds_entity_t writer =
      from.create_writer("/lapservo/PSM1/command", Wire<StringMessage>::descriptor(), Delivery::reliable);
  static char text[] = "stop";
  static char no_frame[] = "";
  crtk_msgs_msg_dds__StringStamped_ stop{};
  stop.header.frame_id = no_frame;
  stop.string = text;
  dds_time_t now = dds_time();
  const auto say = [&] { dds_write_ts(writer, &stop, now); };
  commands.get(say);
  for (const std::int64_t step_s : {0, -1, 3600, -7200, 0}) {
    now += DDS_SECS(step_s);
    const std::size_t before = commands.count();
    for (int k = 0; k < 3; ++k) say(), ++now;
    EXPECT_TRUE(testing::wait_for([&] { return commands.count() >= before + 3; })) << step_s;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    EXPECT_EQ(commands.count(), before + 3) << step_s;
  }
}

TEST(Ros2Transport, AStampThatIsNoneIsNotANumber) {
  sensor_msgs_msg_dds__JointState_ wire{};
  wire.header.stamp = {5, 1000000000u};
  EXPECT_TRUE(std::isnan(Wire<JointMessage>::read(wire).stamp_s));
  wire.header.stamp = {5, 999999999u};
  EXPECT_NEAR(Wire<JointMessage>::read(wire).stamp_s, 6, 1e-8);
}

}  // namespace lapservo::internal::ros2_transport_test
