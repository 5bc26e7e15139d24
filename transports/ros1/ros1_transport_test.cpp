#include "transports/ros1/ros1_transport.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <netinet/in.h>
#include <ros/master.h>
#include <set>
#include <string>
#include <sys/socket.h>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_inbox.h"
#include "lapservo/crtk/test_messages.h"
#include "lapservo/testing/input_error.h"
#include "lapservo/testing/process.h"
#include "lapservo/testing/wait_for.h"
#include "transports/ros1/ros1_node.h"
#include "transports/ros1/test_ros_master.h"

namespace lapservo::internal::ros1_transport_test {
using testing::wait_for;

constexpr double stamp_s = sample_stamp_s;

TEST(Ros1Master, IsMissedInOneLineWithinTwoSeconds) {
  const TestPort closed, silent(true);
  for (const int port : {closed.number(), silent.number()}) {
    const auto begin = std::chrono::steady_clock::now();
    const std::string said = testing::input_error([&] { require_ros1_master({"127.0.0.1", port}); });
    EXPECT_NE(said.find("ROS_MASTER_URI: is http://127.0.0.1:" + std::to_string(port)), std::string::npos) << said;
    EXPECT_NE(said.find("start roscore"), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2)) << said;
  }
}

// All of this process but those to the master, as a network loses them.
void break_connections() {
  for (int file = 3; file < 1024; ++file) {
    sockaddr_in peer{};
    socklen_t size = sizeof peer;
    if (::getpeername(file, reinterpret_cast<sockaddr*>(&peer), &size) == 0 && peer.sin_family == AF_INET &&
        ntohs(peer.sin_port) != ros::master::getPort())
      ::shutdown(file, SHUT_RDWR);
  }
}

// A master, this process's node, and another process that says again what it hears.
class Ros1Wire : public ::testing::Test {
 protected:
  void SetUp() override { transport_ = std::make_unique<Ros1Transport>("tester"); }
  static std::unique_ptr<testing::Process> peer() { return std::make_unique<testing::Process>(LAPSERVO_ROS1_PEER); }

  TestRosMaster master_;
  std::unique_ptr<testing::Process> peer_ = peer();
  std::unique_ptr<Ros1Transport> transport_;
};

TEST_F(Ros1Wire, CarriesEveryKindOfMessageThereAndBack) {
  TestInbox<OperatingStateMessage> states;
  const auto state_subscription = transport_->subscribe<OperatingStateMessage>("out/state", states.handler());
  EXPECT_EQ(states.get([] {}).state, "DISABLED");  // said before anybody listened
  states.clear();
  const auto say_state = transport_->publisher<OperatingStateMessage>("in/state");
  expect_same(states.get([&] { say_state(sample_state); }), sample_state);
  expect_carries_each_kind(*transport_, "/in/", *transport_, "/out/");
}

// Else a connection that was lost would make a stranger of an arm, and of who said stop.
TEST_F(Ros1Wire, ASenderIsAProcessWhateverItsTopicsAndConnections) {
  TestInbox<OperatingStateMessage> states;
  TestInbox<JointMessage> joints;
  const auto state_subscription = transport_->subscribe<OperatingStateMessage>("/out/state", states.handler());
  const auto joint_subscription = transport_->subscribe<JointMessage>("/out/joints", joints.handler());
  const auto say = transport_->publisher<JointMessage>("/in/joints");
  const std::uint64_t source = states.get([] {}).source;
  EXPECT_EQ(joints.get([&] { say(sample_joints); }).source, source);
  states.clear();
  break_connections();
  EXPECT_EQ(states.get([] {}).source, source);
  peer_ = nullptr;
  states.clear();
  peer_ = peer();
  EXPECT_NE(states.get([] {}).source, source) << "started again, it is another arm";
}

TEST_F(Ros1Wire, ALatchedMessageIsNewFromASenderThatIsNew) {
  TestInbox<StringMessage> latched, others;
  const auto latched_subscription = transport_->subscribe<StringMessage>("/out/kept", latched.handler());
  const auto other_subscription = transport_->subscribe<StringMessage>("/out/text", others.handler());
  const auto ask = transport_->publisher<StringMessage>("/in/text");
  EXPECT_EQ(others.get([&] { ask(sample_string); }).latched, Latched::no);
  EXPECT_EQ(latched.get([] {}).latched, Latched::perhaps);
  latched.clear();
  break_connections();
  EXPECT_EQ(latched.get([] {}).latched, Latched::again);
  peer_ = nullptr;
  latched.clear();
  peer_ = peer();
  EXPECT_EQ(latched.get([] {}).latched, Latched::perhaps);
}

TEST_F(Ros1Wire, KnowsWhoReads) {
  using Names = std::set<std::string>;
  const auto say = transport_->set_point_publisher("/in/joints"),
             alone = transport_->publisher<JointMessage>("/nobody");
  const auto own = transport_->subscribe<JointMessage>("/in/joints", [](JointMessage&&) {});
  const auto become = [&](const Names& names) {
    return wait_for([&] { return transport_->readers("in/joints") == names; });
  };
  EXPECT_TRUE(become({"/peer"}));
  EXPECT_EQ(transport_->readers("/nobody"), Names());
  peer_ = nullptr;
  EXPECT_TRUE(become({}));
  peer_ = peer();
  EXPECT_TRUE(become({"/peer"}));
}

TEST_F(Ros1Wire, HearsCommandsOfAnyTypeButNotItself) {
  TestInbox<CommandMessage> joints, trajectories, own;
  const auto nothing = CommandType::nothing;
  const auto joint_subscription = transport_->subscribe_commands("/out/joints", nothing, joints.handler());
  const auto trajectory_subscription =
      transport_->subscribe_commands("/out/trajectory", nothing, trajectories.handler());
  const auto own_subscription = transport_->subscribe_commands("/in/joints", nothing, own.handler());
  const auto say_joints = transport_->publisher<JointMessage>("/in/joints");
  const auto say_trajectory = transport_->publisher<TrajectoryMessage>("/in/trajectory");
  joints.get([&] { say_joints({stamp_s, {}, {1}}); });
  trajectories.get([&] { say_trajectory({stamp_s, {}, {}}); });
  EXPECT_TRUE(own.empty());
}

TEST_F(Ros1Wire, NoTopicWaitsForAnother) {
  std::atomic<bool> release = false, blocked = false;
  const auto slow = transport_->subscribe<StringMessage>("/out/text", [&](StringMessage&&) {
    blocked = true;
    while (!release) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  });
  const auto ask = transport_->publisher<StringMessage>("/in/text");
  ASSERT_TRUE(wait_for([&] {
    ask({stamp_s, "x"});
    return blocked.load();
  }));
  TestInbox<JointMessage> joints;
  const auto subscription = transport_->subscribe<JointMessage>("/out/joints", joints.handler());
  const auto say = transport_->publisher<JointMessage>("/in/joints");
  EXPECT_EQ(joints.get([&] { say({stamp_s, {}, {1}}); }).positions, std::vector<double>{1});
  release = true;
}

TEST_F(Ros1Wire, AStopIsHeardThoughAnotherFloodsItsTopic) {
  const testing::Process flooder(LAPSERVO_ROS1_PEER, {"flooder"});
  std::atomic<bool> release = false, found = false, stopped = false;
  std::atomic<int> floods = 0;
  const auto subscription = transport_->subscribe<StringMessage>("/out/text", [&](StringMessage&& message) {
    if (message.text == "flooder") {
      found = true;
      while (!release) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    if (message.text == "stop") stopped = true;
    if (message.text == "flood") ++floods;
  });
  const auto ask = transport_->publisher<StringMessage>("/in/text");
  ASSERT_TRUE(wait_for([&] {
    ask({stamp_s, "who"});
    return found.load();
  }));
  ask({stamp_s, "stop"});
  ask({stamp_s, "flood"});
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  release = true;
  EXPECT_TRUE(wait_for([&] { return stopped && floods > 100; }));
}

TEST_F(Ros1Wire, StrangersMessagesAreDroppedAndTold) {
  ::testing::internal::CaptureStderr();
  TestInbox<JointMessage> odd, pretended;
  const auto odd_subscription = transport_->subscribe<JointMessage>("/out/odd", odd.handler());
  const auto pretended_subscription = transport_->subscribe<JointMessage>("/out/pretender", pretended.handler());
  TestInbox<StringMessage> echo;
  const auto echo_subscription = transport_->subscribe<StringMessage>("/out/text", echo.handler());
  const auto ask = transport_->publisher<StringMessage>("/in/text");
  for (int i = 0; i < 4; ++i) {
    echo.clear();
    echo.get([&] { ask({stamp_s, "pretend"}); });
    std::this_thread::sleep_for(std::chrono::seconds(1));  // roscpp queries the master after 1 s and 3 s
  }
  const std::string said = ::testing::internal::GetCapturedStderr();
  EXPECT_TRUE(odd.empty());
  EXPECT_TRUE(pretended.empty());
  EXPECT_NE(said.find("ROS: /out/odd is sensor_msgs/Image, expected sensor_msgs/JointState\n"), std::string::npos)
      << said;
  const std::string unreadable =
      "ROS: /out/pretender: dropping messages of /peer that can't be read as sensor_msgs/JointState\n";
  EXPECT_NE(said.find(unreadable), std::string::npos) << said;
  EXPECT_EQ(said.find(unreadable), said.rfind(unreadable)) << said;
}

// Connections survive the master's death; a publisher that dies falls silent, and is heard when it is back.
TEST_F(Ros1Wire, OutlivesMasterAndPeer) {
  TestInbox<JointMessage> joints;
  const auto subscription = transport_->subscribe<JointMessage>("/out/joints", joints.handler());
  const auto say = transport_->publisher<JointMessage>("/in/joints");
  const auto hear = [&] { joints.get([&] { say({stamp_s, {}, {1}}); }); };
  hear();
  peer_ = nullptr;
  joints.clear();
  say({stamp_s, {}, {1}});
  peer_ = peer();
  hear();
  master_.kill();
  joints.clear();
  hear();
}

// Last: what could not be unregistered stays for the rest of this process.
TEST_F(Ros1Wire, EndsThoughItsMasterHangs) {
  TestInbox<JointMessage> joints;
  auto subscription = transport_->subscribe<JointMessage>("/out/joints", joints.handler());
  auto say = transport_->publisher<JointMessage>("/in/joints");
  joints.get([&] { say({stamp_s, {}, {1}}); });
  auto lonely = transport_->subscribe<JointMessage>("/nobody", joints.handler());
  master_.stop();
  std::this_thread::sleep_for(std::chrono::milliseconds(1200));  // roscpp queries the master for such a topic
  const auto begin = std::chrono::steady_clock::now();
  lonely = subscription = nullptr;
  say = nullptr;
  transport_ = nullptr;
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(5));
  const std::size_t heard = joints.count();
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(joints.count(), heard);
}

}  // namespace lapservo::internal::ros1_transport_test
