#include "lapservo/sim_robot/sim_robot.h"

#include <gtest/gtest.h>

#include "lapservo/crtk/image_receiver.h"
#include "lapservo/crtk/interlock.h"
#include "lapservo/crtk/test_transport.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/wait_for.h"

namespace lapservo::internal::sim_robot_test {

// Both sides of the topics in memory, on one time that passes as the test says.
class Room {
 public:
  Room() : rig(testing::small_test_rig()), simulator(rig, simulated(), {0.05, 1.57, 0.064, 1.2}) {
    rig.instruments[0].joints = default_joints();
    interlock.emplace(interlock_of(rig.instruments[0], {}, true, 1));
    robot.emplace(transport, rig, simulator, SimRobotConfig{});
    subscriptions.push_back(transport.subscribe<JointMessage>(
        "/PSM1/measured_js", [this](JointMessage&& message) { interlock->on_measured(message, now_s); }));
    subscriptions.push_back(transport.subscribe<JointMessage>(
        "/PSM1/setpoint_js", [this](JointMessage&& message) { interlock->on_setpoint(message, now_s); }));
    subscriptions.push_back(transport.subscribe<OperatingStateMessage>(
        "/PSM1/operating_state",
        [this](OperatingStateMessage&& message) { interlock->on_operating_state(message, now_s); }));
  }
  static SimulatorConfig simulated() {
    SimulatorConfig config;
    config.endoscope.frame_rate_hz = 30;
    return config;
  }
  // The topics' two ends and the loop's, once each millisecond.
  void pass(double duration_s, const Eigen::Vector4d& velocity) {
    for (const double end_s = now_s + duration_s; now_s < end_s; now_s += 0.001) {
      transport.stamp_s = 1.7e9 + now_s;
      robot->advance(now_s);
      transport.deliver();
      const JointState state = interlock->state(now_s);
      if (state.blocked != Blocked::none) {
        path.reset(now_s, state.q.vector());
      } else {
        path.ramp_to(now_s, velocity, 0.01);
        interlock->follow(path);
      }
      if (const auto sent = interlock->tick(now_s))
        transport.say("/PSM1/servo_jp", JointMessage{transport.stamp_s, interlock->names(), *sent});
    }
  }

  Rig rig;
  Simulator simulator;
  TestTransport transport;
  std::optional<Interlock> interlock;
  std::optional<SimRobot> robot;
  JointPath path{JointLimits().acceleration};
  std::vector<Transport::Subscription> subscriptions;
  double now_s = 0;
};

TEST(SimRobot, OffersItsImagesCompressedToThoseWhoReadThem) {
  const std::string topic = "/endoscope/image_raw/compressed";
  Room room;
  room.transport.let_read({});
  room.pass(0.3, Eigen::Vector4d::Zero());
  EXPECT_TRUE(room.transport.sent<CompressedImageMessage>(topic).empty());
  room.transport.let_read({"/viewer"});
  ImageReceiver received(640, 360);
  ASSERT_TRUE(testing::wait_for([&] {
    room.pass(0.1, Eigen::Vector4d::Zero());
    return !room.transport.sent<CompressedImageMessage>(topic).empty();
  }));
  received.receive(CompressedImageMessage(room.transport.sent<CompressedImageMessage>(topic).front()), room.now_s);
  const auto image = received.newest();
  ASSERT_TRUE(image) << received.complaint();
  EXPECT_EQ(image->bgr.size(), cv::Size(640, 360));
}

TEST(SimRobot, ObeysStateCommandsAndNothingWhilePaused) {
  Room room;
  room.pass(0.2, {0.05, 0, 0, 0});
  room.transport.say("/PSM1/state_command", StringMessage{0, "pause"});
  room.pass(0.01, {0.05, 0, 0, 0});
  const long count = room.robot->statistics().count;
  const Eigen::Vector4d paused = room.simulator.measured_jp();
  room.pass(0.5, {0.05, 0, 0, 0});
  EXPECT_EQ(room.robot->statistics().count, count);
  EXPECT_LT((room.simulator.measured_jp() - paused).norm(), 2e-3);
  room.transport.say("/PSM1/state_command", StringMessage{0, "resume"});
  room.pass(0.5, {0.05, 0, 0, 0});
  EXPECT_GT(room.robot->statistics().count, count + 300);
}

}  // namespace lapservo::internal::sim_robot_test
