#include "lapservo/crtk/crtk_arm.h"

#include <cmath>

#include <gtest/gtest.h>

#include "lapservo/crtk/test_transport.h"

namespace lapservo::internal::crtk_arm_test {

using Positions = std::vector<double>;

TEST(CrtkArm, GivesTheNewestSetpointOnceAndDropsWhatIsNotOfItsJoints) {
  TestTransport transport;
  CrtkArm arm(transport, "A", {"a", "b"});
  const auto say = [&](const std::vector<std::string>& names, const Positions& positions) {
    transport.say("/A/servo_jp", JointMessage{1, names, positions});
  };
  arm.say_state({0, "ENABLED", true, false});
  say({"a", "b"}, {1, 2});
  say({}, {3, 4});
  EXPECT_EQ(arm.new_setpoint(), Positions({3, 4}));
  EXPECT_FALSE(arm.new_setpoint());
  say({"a", "b"}, {5, 6});
  say({"b", "a"}, {1, 1});
  say({"a", "b"}, {1});
  say({"a", "b"}, {1, NAN});
  EXPECT_EQ(arm.new_setpoint(), Positions({5, 6}));
  EXPECT_EQ(arm.malformed(), 3);
}

// The arm may be elsewhere; a hiccup of 0.3 s must not lose where the loop has braked it.
TEST(CrtkArm, ASetpointIsVoidOnceTheLoopHasGivenItUpOrTheArmDidNotObey) {
  TestTransport transport;
  CrtkArm arm(transport, "A", {"a"});
  const auto remains = [&](double after_s, const std::vector<OperatingStateMessage>& states) {
    transport.say("/A/servo_jp", JointMessage{1, {"a"}, {1}});
    for (const OperatingStateMessage& state : states) arm.say_state(state);
    transport.stamp_s += after_s;
    return arm.new_setpoint().has_value();
  };
  const OperatingStateMessage enabled{0, "ENABLED", true, false};
  EXPECT_FALSE(remains(0, {enabled}));  // came before the arm said anything
  EXPECT_TRUE(remains(0.3, {enabled}));
  EXPECT_FALSE(remains(0.8, {enabled}));
  EXPECT_FALSE(remains(0, {{0, "PAUSED", true, false}, enabled}));
  EXPECT_FALSE(remains(0, {{0, "ENABLED", true, true}}));
  EXPECT_FALSE(remains(0, {enabled}));  // came while it was busy
  EXPECT_TRUE(remains(0, {}));
}

TEST(CrtkArm, KeepsEveryCommandInItsOrder) {
  TestTransport transport;
  CrtkArm arm(transport, "A", {"a"});
  for (const char* word : {"enable", "home"}) transport.say("/A/state_command", StringMessage{0, word});
  EXPECT_EQ(arm.new_commands(), std::vector<std::string>({"enable", "home"}));
  EXPECT_TRUE(arm.new_commands().empty());
}

TEST(CrtkArm, SaysAStateAtEachChangeAndEveryHalfSecond) {
  TestTransport transport;
  CrtkArm arm(transport, "A", {"a"});
  const auto count = [&] { return transport.sent<OperatingStateMessage>("/A/operating_state").size(); };
  const OperatingStateMessage enabled{0, "ENABLED", true, false};
  for (int i = 0; i < 100; ++i, transport.stamp_s += 0.01) arm.say_state(enabled);
  EXPECT_EQ(count(), 2u);
  for (const bool is_homed : {true, false}) arm.say_state({0, "ENABLED", is_homed, true});
  arm.say_state({0, "PAUSED", false, true});
  EXPECT_EQ(count(), 5u);
  EXPECT_EQ(transport.sent<OperatingStateMessage>("/A/operating_state").back().stamp_s, transport.stamp_s);
}

}  // namespace lapservo::internal::crtk_arm_test
