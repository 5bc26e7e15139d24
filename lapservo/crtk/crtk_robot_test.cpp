#include "lapservo/crtk/crtk_robot.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "lapservo/crtk/operator_presence.h"
#include "lapservo/crtk/test_transport.h"
#include "lapservo/testing/process.h"
#include "lapservo/testing/wait_for.h"

namespace lapservo::internal::crtk_robot_test {
using testing::wait_for;

InterlockConfig config_of() {
  InterlockConfig config;
  config.joints = {{"yaw", "pitch", "insertion", "roll"}, {1, 1, 1, 1}, {}};
  config.motion_enabled = true;
  return config;
}

// On topics in memory, with a path that rests, which it sends.
struct Room {
  Room() {
    say_all(1000);
    EXPECT_NE(robot.state().blocked, Blocked::none);  // before
    const JointState state = robot.state();
    EXPECT_EQ(state.blocked, Blocked::none);
    EXPECT_EQ(state.operating_state, OperatingState::enabled);
    EXPECT_EQ(state.q.psi_rad, 0.2);
    JointPath path(JointLimits().acceleration);
    path.reset(10, state.q.vector());
    robot.send(path);
    clock.now = 10.01;
    say_all(1000.01);
  }
  void say_all(double stamp_s) {
    const JointMessage message{stamp_s, {"yaw", "pitch", "insertion", "roll", "wrist"}, {0.1, 1.5, 0.1, 0.2, 0.7}};
    transport.say("/PSM1/measured_js", message);
    transport.say("/PSM1/setpoint_js", message);
    transport.say("/PSM1/operating_state", OperatingStateMessage{stamp_s, "ENABLED", true, false});
  }

  TestTransport transport;
  StandingClock clock;
  CrtkRobot robot{transport, "PSM1", config_of(), clock};
};

TEST(CrtkRobot, SendsSetPointsOfAllJointsInItsOwnThreadUntilSomethingIsAmiss) {
  Room room;
  ASSERT_TRUE(wait_for([&] { return room.transport.sent<JointMessage>("/PSM1/servo_jp").size() > 5; }));
  const JointMessage sent = room.transport.sent<JointMessage>("/PSM1/servo_jp").front();
  EXPECT_EQ(sent.names, (std::vector<std::string>{"yaw", "pitch", "insertion", "roll", "wrist"}));
  EXPECT_EQ(sent.positions, (std::vector<double>{0.1, 1.5, 0.1, 0.2, 0.7}));
  EXPECT_EQ(sent.velocities, std::vector<double>(5, 0.0));
  room.clock.now = 10.2;  // nothing came since
  ASSERT_TRUE(wait_for([&] { return !room.robot.set_point(); }));
  EXPECT_EQ(room.robot.state().blocked, Blocked::old_joint_states);
}

TEST(CrtkRobot, ACommandOfAnotherByAnyTopicOfMotionHolds) {
  for (const std::string& topic : testing::words_of(
           "servo_jp servo_jr servo_jv servo_jf pid_feed_forward/servo_jf move_jp move_jr servo_cp servo_cr move_cp "
           "move_cr servo_cv servo_cf body/servo_cf spatial/servo_cf servo_cs servo_ci servo_js "
           "../PID/PSM1/servo_jp ../PID/PSM1/servo_jf ../PID/PSM1/feed_forward/servo_jf ../PID/PSM1/enable "
           "use_gravity_compensation hold free")) {
    Room room;
    EXPECT_EQ(room.robot.state().blocked, Blocked::none) << topic;
    room.transport.say(std::filesystem::path(topic_of("PSM1", topic)).lexically_normal(), CommandMessage());
    EXPECT_EQ(room.robot.state().blocked, Blocked::foreign_command) << topic;
    EXPECT_FALSE(room.robot.set_point()) << topic;
  }
}

TEST(CrtkRobot, TellsAFaultsWords) {
  Room room;
  room.transport.say("/PSM1/error", TextMessage{"power loss"});
  room.transport.say("/PSM1/operating_state", OperatingStateMessage{1000.01, "FAULT"});
  EXPECT_EQ(room.robot.state().other_state, "FAULT (power loss)");
}

TEST(CrtkRobot, SaysOnceWhoReadsBesideTheArm) {
  ::testing::internal::CaptureStderr();
  Room room;
  room.transport.let_read({"/arm", "/recorder"});
  for (int k = 0; k < 3; ++k) EXPECT_EQ(room.robot.state().blocked, Blocked::second_reader);
  EXPECT_TRUE(wait_for([&] { return !room.robot.set_point(); }));  // its own thread brakes
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            "lapservo: /PSM1/servo_jp is read by /arm, /recorder, expected 1\n");
}

TEST(CrtkRobot, AnArmsInstrumentHasTheLastPartOfItsName) {
  for (const char* arm : {"PSM1", "/PSM1", "dvrk/PSM1", "SIM_PSM1", "/dvrk/SIM_PSM1"})
    EXPECT_EQ(instrument_of(arm), "PSM1") << arm;
}

TEST(OperatorPresence, IsAButtonThatIsPressedThroughoutAndSaysSo) {
  TestTransport transport;
  StandingClock clock;
  OperatorPresence presence(transport, "/pedal", clock);
  const auto say = [&](const std::vector<std::int32_t>& buttons) {
    transport.say("/pedal", first_button(JoyMessage{0, buttons}));
  };
  EXPECT_FALSE(presence.was_present());
  say({1});
  EXPECT_TRUE(presence.was_present());
  clock.now = 10.19;
  EXPECT_TRUE(presence.was_present());
  clock.now = 10.21;
  EXPECT_FALSE(presence.was_present());
  say({1, 0});
  EXPECT_TRUE(presence.was_present());
  for (const std::vector<std::int32_t>& buttons : std::vector<std::vector<std::int32_t>>{{0}, {}, {2}, {0, 1}}) {
    say(buttons);
    say({1});  // pressed again before the next query
    EXPECT_FALSE(presence.was_present());
    EXPECT_TRUE(presence.was_present());
  }
}

}  // namespace lapservo::internal::crtk_robot_test
