// The closed loop through ROS 2's wire and ROS 1's: `lapservo servo` as a process of its own steers an arm in another
// process or in this one, over loopback. Assertions use the stamps of messages and counts, not the speed of this
// computer; waits end early.

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "acceptance/process.h"
#include "lapservo/control/paper_trajectory.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/robot/held_button.h"
#include "lapservo/sim_robot/sim_robot.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/wait_for.h"
#include "transports/named_transport.h"
#ifdef LAPSERVO_WEB
#include "web/test_http.h"
#endif
#ifdef LAPSERVO_ROS1
#include "transports/ros1/test_ros_master.h"
#endif

namespace lapservo::internal {
namespace {
using testing::wait_for;

constexpr double allowed_s = 0.1;  // from a fault to the last setpoint
constexpr double tick_s = 1.0 / 500;
const JointLimits limits;  // those of the file, but for rounded positions
const double rest_s = (limits.rate.cwiseQuotient(limits.acceleration)).maxCoeff();

// Those that this build has.
std::vector<std::string> transports() {
  return {
#ifdef LAPSERVO_ROS2
      "ros2",
#endif
#ifdef LAPSERVO_ROS1
      "ros1",
#endif
  };
}

double now_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

void sleep(double duration_s) {
  std::this_thread::sleep_for(std::chrono::duration<double>(duration_s));
}

// The tool with these arguments, its output in a file; killed with the object.
struct Process : acceptance::Process {
  Process(const std::vector<std::string>& arguments, const std::string& output)
      : acceptance::Process(LAPSERVO_TOOL, arguments, output) {}
};

// The setpoints that any listener on the arm's topics receives.
class Spy {
 public:
  explicit Spy(Transport& transport)
      : subscription_(transport.subscribe_joints("/PSM1/servo_jp", [this](JointMessage&& message) {
          const std::lock_guard lock(mutex_);
          heard_.push_back(
              {message.stamp_s, q_from_joints(default_joints(), Eigen::Vector4d(message.positions.data()))});
        })) {}

  struct SetPoint {
    double stamp_s = 0;
    Eigen::Vector4d q = Eigen::Vector4d::Zero();
  };
  std::vector<SetPoint> heard() {
    const std::lock_guard lock(mutex_);
    return heard_;
  }
  std::size_t count() { return heard().size(); }
  // Soon; says something meanwhile.
  bool count_exceeds(std::size_t number, const std::function<void()>& say) {
    return wait_for([&] {
      say();
      return count() > number;
    });
  }
  double last_s() {
    const auto all = heard();
    return all.empty() ? 0 : all.back().stamp_s;
  }
  // Whether they change: not at rest.
  bool moves_after(double stamp_s) {
    Eigen::Vector4d first = Eigen::Vector4d::Constant(NAN);
    for (const SetPoint& set_point : heard()) {
      if (set_point.stamp_s <= stamp_s) continue;
      if (first.hasNaN()) first = set_point.q;
      if ((set_point.q - first).cwiseAbs().maxCoeff() > 1e-9) return true;
    }
    return false;
  }
  // The last two are those of the end of a motion that brakes.
  void expect_braked() {
    const auto all = heard();
    ASSERT_GE(all.size(), 2u);
    const SetPoint &last = all.back(), &before = all[all.size() - 2];
    const double passed_s = std::max(last.stamp_s - before.stamp_s, tick_s) + 1e-3;
    const Eigen::Array4d step = (last.q - before.q).cwiseAbs();
    EXPECT_TRUE((step <= limits.acceleration.array() * passed_s * passed_s).all()) << step.transpose();
  }
  // Among messages of one sender: no step is farther than the rate limit over the time between the two, or over a tick.
  void expect_no_jump() {
    const auto all = heard();
    for (std::size_t i = 1; i < all.size(); ++i) {
      const double passed_s = std::max(all[i].stamp_s - all[i - 1].stamp_s, tick_s) + 1e-3;
      const Eigen::Array4d step = (all[i].q - all[i - 1].q).cwiseAbs();
      EXPECT_TRUE((step <= limits.rate.array() * passed_s).all()) << i << ": " << step.transpose();
    }
  }

 private:
  std::mutex mutex_;
  std::vector<SetPoint> heard_;
  Transport::Subscription subscription_;
};

// Section V-D as the half-size camera sees it, and that camera's rig.
class WireLoop : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    ::setenv("ROS_LOCALHOST_ONLY", "1", 1);
    if (!std::getenv("ROS_DOMAIN_ID")) ::setenv("ROS_DOMAIN_ID", "88", 1);
#ifdef LAPSERVO_ROS1
    if (GetParam() == "ros1") master_ = std::make_unique<TestRosMaster>();
#endif
    rig_ = testing::small_test_rig();
    testing::write_file(folder_ / "rig.yaml", rig_yaml(rig_));
    testing::write_file(folder_ / "limits.yaml",
                        "lower: [-1, -0.92, 0.045, -4]\nupper: [1, 0.97, 0.21, 4]\n"
                        "rate: [0.4, 0.4, 0.04, 1.5]\nacceleration: [2, 2, 0.2, 7.5]\n");
    Sinusoids f = paper_sinusoids();
    f.offset.tail<3>() /= 2;
    f.amplitude.tail<3>() /= 2;
    const Trajectory trajectory = sinusoids(f);
    std::string csv = "time_s,s_rad,r_px,l_px,d_px\n";
    for (int k = 0; k < 9000; ++k) {
      const Eigen::Vector4d d = trajectory.at(k * 0.02).features;
      csv += fmt::format("{},{},{},{},{}\n", k * 0.02, d[0], d[1], d[2], d[3]);
    }
    testing::write_file(folder_ / "v-d.csv", csv);
  }
  std::string file(const std::string& name) const {
    return (folder_ / name).string();
  }
  std::string said(const std::string& name) const {
    return testing::read_file(folder_ / name);
  }
  // By the loop, after its first so many letters.
  void expect_soon_said(const std::string& words, std::size_t after = 0) const {
    EXPECT_TRUE(wait_for([&] { return said("servo.txt").find(words, after) != std::string::npos; }))
        << "no '" << words << "' in: " << said("servo.txt");
  }

  std::unique_ptr<Process> servo(double duration_s, const std::string& output = "servo.txt", bool motion = true,
                                 const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{"servo",
                                       "--rig",
                                       file("rig.yaml"),
                                       "--trajectory",
                                       file("v-d.csv"),
                                       "--robot",
                                       GetParam() + ":PSM1",
                                       "--camera",
                                       GetParam() + ":/endoscope/image_raw",
                                       "--fps",
                                       "30",
                                       "--duration",
                                       fmt::format("{}", duration_s)};
    if (motion)
      arguments.insert(arguments.end(), {"--enable-motion", "--joint-limits", file("limits.yaml"), "--setpoint-readers",
                                         std::to_string(setpoint_readers_)});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return std::make_unique<Process>(arguments, file(output));
  }
  std::unique_ptr<Process> arm() const {
    return std::make_unique<Process>(
        std::vector<std::string>{"sim-robot", "--rig", file("rig.yaml"), "--start", "0.05,1.57,0.064,1.2",
                                 "--transport", GetParam(), "--arm", "PSM1"},
        file("arm.txt"));
  }
  // Where servo says that its page is; 0 when it does not say it.
  int page_port(const std::string& output = "servo.txt") const {
    const std::string before = "page: http://127.0.0.1:";
    std::size_t at = std::string::npos;
    wait_for([&] { return (at = said(output).find(before)) != std::string::npos; });
    return at == std::string::npos ? 0 : std::stoi(said(output).substr(at + before.size()));
  }
  // From what servo says in its last lines.
  void expect_steady(const std::string& output) const {
    const std::string text = said(output), before = "\nwithin 1 px and 5 mrad from ";
    const std::size_t at = text.find(before);
    ASSERT_NE(at, std::string::npos) << text;
    double reached_s = 0, s_mrad = 0, r = 0, l = 0, d = 0;
    ASSERT_EQ(std::sscanf(text.c_str() + at + before.size(), "%lf s on; rms since: s %lf mrad, r %lf, l %lf, d %lf px",
                          &reached_s, &s_mrad, &r, &l, &d),
              5)
        << text;
    EXPECT_LE(reached_s, 5) << text;
    EXPECT_LE(s_mrad, 0.5) << text;
    EXPECT_LE(std::max({r, l, d}), 0.3) << text;
  }

  Rig rig_;
  testing::TemporaryFolder folder_;
  int setpoint_readers_ = 2;  // the arm and this process's ears
#ifdef LAPSERVO_ROS1
  std::unique_ptr<TestRosMaster> master_;
#endif
};
// Code that all wires share is tested on the first one only: it is in real time.
class FirstWireLoop : public WireLoop {};
INSTANTIATE_TEST_SUITE_P(Over, WireLoop, ::testing::ValuesIn(transports()),
                         [](const auto& wire) { return wire.param; });
INSTANTIATE_TEST_SUITE_P(Over, FirstWireLoop, ::testing::Values(transports().front()),
                         [](const auto& wire) { return wire.param; });

// An arm in this process, that can be made to misbehave.
class Arm {
 public:
  Arm(const std::string& transport, const Rig& rig)
      : transport_(named_transport(transport, "arm")),
        simulator_(rig, simulated(), {0.05, 1.57, 0.064, 1.2}),
        robot_(*transport_, rig, simulator_, config()) {
    thread_ = std::thread([this] {
      const double begin_s = now_s();
      double paused_s = 0;
      while (!ended_) {
        sleep(0.001);
        if (silent) {
          paused_s = now_s() - begin_s - simulator_.now_s();
        } else {
          robot_.advance(now_s() - begin_s - paused_s);
        }
      }
    });
  }
  ~Arm() {
    ended_ = true;
    thread_.join();
  }
  Arm(const Arm&) = delete;
  Arm& operator=(const Arm&) = delete;

  SimRobot& robot() { return robot_; }

  std::atomic<bool> silent = false, nan = false, frozen = false, stuck = false, blind = false;
  std::atomic<double> clock_off_s = 0;  ///< of its computer, and of its camera's

 private:
  static SimulatorConfig simulated() {
    SimulatorConfig config;
    config.endoscope.frame_rate_hz = 30;
    config.endoscope.real_time = true;
    return config;
  }
  SimRobotConfig config() {
    SimRobotConfig config;
    config.alter_measured = [this](JointMessage& message) {
      if (nan) message.positions[1] = NAN;
      message.stamp_s += clock_off_s;
    };
    config.alter_image = [this](ImageMessage& message) {
      if (frozen) message.stamp_s = last_stamp_s_;
      last_stamp_s_ = message.stamp_s;
      message.stamp_s += clock_off_s;
      if (stuck) {
        message.data = last_data_;
      } else {
        last_data_ = message.data;
      }
      if (blind) message.stamp_s = NAN;  // as if there were none
    };
    return config;
  }

  std::unique_ptr<Transport> transport_;
  Simulator simulator_;
  double last_stamp_s_ = 0;
  decltype(ImageMessage::data) last_data_{};
  SimRobot robot_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

TEST_P(WireLoop, ASimulatedArmHasANameOfItsOwnAndRefusesOneThatIsTaken) {
  const std::vector<std::string> command{"sim-robot",           "--rig",      file("rig.yaml"),
                                         "--transport",         GetParam(),   "--start",
                                         "0.05,1.57,0.064,1.2", "--duration", "1"};
  Process own(command, file("own.txt"));
  EXPECT_EQ(own.wait(), 0);
  EXPECT_EQ(said("own.txt").find("arm SIM_PSM1, "), 0u) << said("own.txt");
  Arm room(GetParam(), rig_);
  auto taken = command;
  taken.insert(taken.end(), {"--arm", "PSM1"});
  Process second(taken, file("second.txt"));
  EXPECT_EQ(second.wait(), 2);
  EXPECT_NE(said("second.txt").find("--arm: is PSM1, where an arm is already"), std::string::npos)
      << said("second.txt");
}

TEST_P(WireLoop, TwoProcessesConverge) {
  const auto room = arm();
  const auto loop = servo(8);
  EXPECT_EQ(loop->wait(), 0) << said("servo.txt") << said("arm.txt");
  expect_steady("servo.txt");
}

#ifdef LAPSERVO_ROS1
TEST_P(FirstWireLoop, AMasterThatIsNotThereIsSaidWithinTwoSeconds) {
  const TestPort closed;
  ::setenv("ROS_MASTER_URI", fmt::format("http://127.0.0.1:{}", closed.number()).c_str(), 1);
  const double begin_s = now_s();
  Process arm({"sim-robot", "--rig", file("rig.yaml"), "--start", "0.05,1.57,0.064,1.2", "--transport", "ros1"},
              file("arm.txt"));
  EXPECT_EQ(arm.wait(), 2);
  EXPECT_LT(now_s() - begin_s, 2);
  const std::string text = said("arm.txt");
  EXPECT_EQ(text.find("lapservo: ROS_MASTER_URI: is http://127.0.0.1:"), 0u) << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
}
#endif

TEST_P(FirstWireLoop, ObservesOnlyWithoutEnableMotion) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  Spy spy(*ears);
  const auto loop = servo(3, "servo.txt", false);
  loop->wait();
  EXPECT_EQ(spy.count(), 0u);
  EXPECT_NE(said("servo.txt").find("would send outer_yaw "), std::string::npos) << said("servo.txt");
}

struct Fault {
  const char* name;
  std::function<void(Arm&)> begin, end;
  const char* said;
  bool silent;  // no setpoint is sent any more; else they come to rest
};

TEST_P(FirstWireLoop, HoldsAtAFaultWithin100MillisecondsAndGoesOnAfterAStartWithoutAJump) {
  const std::vector<Fault> faults{
      {"NaN", [](Arm& a) { a.nan = true; }, [](Arm& a) { a.nan = false; }, "non_finite_joints", true},
      {"PAUSED", [](Arm& a) { a.robot().set_state(OperatingState::paused); },
       [](Arm& a) { a.robot().set_state(OperatingState::enabled); }, "the arm is PAUSED", true},
      {"FAULT", [](Arm& a) { a.robot().set_state(OperatingState::fault); },
       [](Arm& a) { a.robot().set_state(OperatingState::enabled); }, "the arm is FAULT", true},
      {"silence", [](Arm& a) { a.silent = true; }, [](Arm& a) { a.silent = false; }, "old_joint_states", true},
      {"repeated stamps", [](Arm& a) { a.frozen = true; }, [](Arm& a) { a.frozen = false; }, "stale_image", false},
      {"the same image", [](Arm& a) { a.stuck = true; }, [](Arm& a) { a.stuck = false; }, "frozen_image", false},
      {"no image", [](Arm& a) { a.blind = true; }, [](Arm& a) { a.blind = false; }, "stale_image", false},
  };
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  Spy spy(*ears);
  const auto command = ears->string_publisher("/lapservo/PSM1/command");
  const auto loop = servo(600);
  for (const Fault& fault : faults) {
    SCOPED_TRACE(fault.name);
    const std::size_t before = spy.count();
    ASSERT_TRUE(wait_for([&] { return spy.count() > before + 500; })) << said("servo.txt");
    const std::size_t said_before = said("servo.txt").size();
    const double fault_s = now_s();
    fault.begin(room);
    expect_soon_said(fault.said, said_before);
    sleep(1);
    if (fault.silent) {
      EXPECT_LE(spy.last_s(), fault_s + allowed_s);
    } else {
      // The loop's period and the age of what it sees come on top of the limit, and braking.
      EXPECT_FALSE(spy.moves_after(fault_s + allowed_s + 2.0 / 30 + rest_s));
    }
    const std::size_t held = spy.count();
    fault.end(room);
    sleep(0.7);
    if (fault.silent) {
      EXPECT_EQ(spy.count(), held);
    }
    ASSERT_TRUE(spy.count_exceeds(held + 100, [&] { command({now_s(), "start"}); })) << said("servo.txt");
  }
  spy.expect_no_jump();
  EXPECT_EQ(room.robot().statistics().malformed, 0);
  EXPECT_EQ(room.robot().statistics().wrist_moved, 0);
  loop->signal(SIGINT);
  loop->wait();
}

TEST_P(FirstWireLoop, RecordsAnArmThatItMovesAndCalibratesFromIt) {
  const auto room = arm();
  // A new user's rig: names alone. As it counts phi, the arm stands far beyond where instruments go.
  Rig blank = rig_;
  blank.instruments[0].joints = Joints{default_joints().names, {1, 1, 1, 1}, {}};
  testing::write_file(folder_ / "blank.yaml", rig_yaml(blank));
  const std::vector<std::string> recording{"record",
                                           "--rig",
                                           file("blank.yaml"),
                                           "--camera",
                                           GetParam() + ":/endoscope/image_raw",
                                           "--robot",
                                           GetParam() + ":PSM1",
                                           "--out",
                                           file("swing"),
                                           "--fps",
                                           "15",
                                           "--move",
                                           "swing",
                                           "--scale",
                                           "0.5",
                                           "--duration",
                                           "10"};
  Process refused(recording, file("refused.txt"));
  EXPECT_EQ(refused.wait(), 2);
  EXPECT_NE(said("refused.txt").find("--enable-motion"), std::string::npos) << said("refused.txt");
  auto moving = recording;
  moving.push_back("--enable-motion");
  Process unlimited(moving, file("unlimited.txt"));
  EXPECT_EQ(unlimited.wait(), 2);
  EXPECT_NE(said("unlimited.txt").find("--joint-limits"), std::string::npos) << said("unlimited.txt");
  moving.insert(moving.end(), {"--joint-limits", file("limits.yaml"), "--setpoint-readers", "2"});
  const auto ears = named_transport(GetParam(), "ears");
  Spy spy(*ears);
  // Pitch stands near a limit, as the arm reads it: said before anything moves.
  testing::write_file(folder_ / "cramped.yaml",
                      "lower: [-1, -1, 0.01, -4]\nupper: [1, 0.03, 0.2, 4]\n"
                      "rate: [0.4, 0.4, 0.04, 1.5]\nacceleration: [2, 2, 0.2, 7.5]\n");
  auto cramped = moving;
  std::replace(cramped.begin(), cramped.end(), file("swing"), file("cramped"));
  std::replace(cramped.begin(), cramped.end(), file("limits.yaml"), file("cramped.yaml"));
  Process still(cramped, file("still.txt"));
  EXPECT_EQ(still.wait(), 1);
  EXPECT_NE(said("still.txt").find("the arm was not moved: outer_pitch would move by 0.0"), std::string::npos)
      << said("still.txt");
  EXPECT_EQ(spy.count(), 0U);

  Process record(moving, file("record.txt"));
  ASSERT_EQ(record.wait(), 0) << said("record.txt");
  EXPECT_NE(said("record.txt").find("outer_pitch moved by 0.2"), std::string::npos) << said("record.txt");
  Process calibrate(
      {"calibrate", "registration", file("swing"), "--rig", file("blank.yaml"), "--out", file("new.yaml")},
      file("calibrate.txt"));
  ASSERT_EQ(calibrate.wait(), 0) << said("calibrate.txt");
  const Instrument measured = load_rig(file("new.yaml")).instruments[0];
  EXPECT_EQ(measured.joints->sign, default_joints().sign);
  constexpr double joint_error_rad = 0.035;  // the simulated arm's own
  EXPECT_NEAR(measured.joints->offset[1], default_joints().offset[1] - joint_error_rad, 4e-3);
  const Rigid3 moved = rig_.instruments[0].camera_from_rcm->inverse() * *measured.camera_from_rcm;
  EXPECT_LT(moved.translation.norm(), 0.5e-3) << said("calibrate.txt");

  // Interrupted on its way it brakes, and keeps what it has.
  std::replace(moving.begin(), moving.end(), file("swing"), file("part"));
  Process interrupted(moving, file("interrupted.txt"));
  const double begun_s = now_s();
  ASSERT_TRUE(wait_for([&] { return spy.moves_after(begun_s); })) << said("interrupted.txt");
  sleep(3);
  interrupted.signal(SIGINT);
  EXPECT_EQ(interrupted.wait(), 0) << said("interrupted.txt");
  EXPECT_TRUE(std::filesystem::exists(file("part") + "/metadata.yaml"));
  spy.expect_braked();
  spy.expect_no_jump();
}

// Forwards, and backwards to where it was.
TEST_P(WireLoop, GoesOnWithoutAJumpWhenTheArmsClockIsSet) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  Spy spy(*ears);
  const auto loop = servo(600);
  int jumps = 0;
  for (const double off_s : {100.0, 0.0}) {
    const std::size_t before = spy.count();
    ASSERT_TRUE(wait_for([&] { return spy.count() > before + 500; })) << said("servo.txt");
    room.clock_off_s = off_s;
    const std::string counted = fmt::format("after a jump of the clock {}", ++jumps);
    expect_soon_said(counted);
  }
  const std::size_t before = spy.count();
  ASSERT_TRUE(wait_for([&] { return spy.count() > before + 500; })) << said("servo.txt");
  loop->signal(SIGINT);
  loop->wait();
  spy.expect_no_jump();
  EXPECT_NE(said("servo.txt").find("2 after a jump of the clock"), std::string::npos) << said("servo.txt");
}

TEST_P(FirstWireLoop, IsHeldWhileASecondArmSaysThatItIsThisOne) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  const auto loop = servo(600);
  Spy spy(*ears);
  ASSERT_TRUE(wait_for([&] { return spy.count() > 300; })) << said("servo.txt");
  const Arm second(GetParam(), rig_);
  expect_soon_said("second_source");
  const std::size_t held = spy.count();
  sleep(0.5);
  EXPECT_EQ(spy.count(), held);
}

TEST_P(FirstWireLoop, IsHeldWhileANodeBesideTheArmReadsItsSetPoints) {
  if (GetParam() == "ros1") GTEST_SKIP() << "this process is one node of ROS 1";
  setpoint_readers_ = 1;
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears"), commander = named_transport(GetParam(), "commander");
  const auto command = commander->string_publisher("/lapservo/PSM1/command");
  const auto start = [&] { command({now_s(), "start"}); };
  auto spy = std::make_unique<Spy>(*ears);  // as a recorder that was there first
  const auto loop = servo(600);
  expect_soon_said("hold: second_reader");
  expect_soon_said("/PSM1/servo_jp is read by /arm, /ears, expected 1");
  for (int i = 0; i < 100; ++i) start(), sleep(0.01);
  EXPECT_EQ(spy->count(), 0u);
  const auto moves = [&] {
    const long before = room.robot().statistics().count;
    return wait_for([&] { return start(), room.robot().statistics().count > before + 300; });
  };
  spy.reset();
  ASSERT_TRUE(moves()) << said("servo.txt");
  const std::size_t moved = said("servo.txt").size();
  spy = std::make_unique<Spy>(*ears);
  expect_soon_said("hold: second_reader", moved);
  sleep(rest_s + allowed_s);
  const long held = room.robot().statistics().count;
  sleep(0.5);
  EXPECT_EQ(room.robot().statistics().count, held);
  spy.reset();
  sleep(1);
  EXPECT_EQ(room.robot().statistics().count, held) << "without a start";
  ASSERT_TRUE(moves()) << said("servo.txt");
  loop->signal(SIGINT);
  loop->wait();
}

TEST_P(WireLoop, ASecondPublisherIsNoticedWithin100MillisecondsAndHoldsUntilAStart) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears"), foreign = named_transport(GetParam(), "foreign");
  const auto say = foreign->joint_publisher("/PSM1/servo_jp");
  const auto command = ears->string_publisher("/lapservo/PSM1/command");
  const auto loop = servo(600);
  Spy spy(*ears);
  ASSERT_TRUE(wait_for([&] { return spy.count() > 300; })) << said("servo.txt");
  const double first_s = now_s();
  const Eigen::Vector4d elsewhere(0.02, 0, 0.08, 1);
  const Eigen::Vector4d theirs = q_from_joints(default_joints(), elsewhere);
  EXPECT_TRUE(wait_for([&] {
    say({now_s(), {}, {elsewhere[0], elsewhere[1], elsewhere[2], elsewhere[3], 0.1, -0.2}});
    return said("servo.txt").find("foreign_command") != std::string::npos;
  }));
  sleep(1.5);
  double last_s = 0;
  for (const Spy::SetPoint& set_point : spy.heard())
    if (!set_point.q.isApprox(theirs, 1e-9)) last_s = set_point.stamp_s;
  EXPECT_GT(last_s, 0);
  EXPECT_LE(last_s, first_s + allowed_s);
  ASSERT_TRUE(spy.count_exceeds(spy.count() + 300, [&] { command({now_s(), "start"}); })) << said("servo.txt");
  loop->signal(SIGINT);
  loop->wait();
}

TEST_P(WireLoop, MovesOnlyWhileTheOperatorPressesAPedalOfEitherType) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  const auto command = ears->string_publisher("/lapservo/PSM1/command");
  const auto joy = ears->joy_publisher("/footpedals/coag");
  const auto button = ears->bool_publisher("/operator_present");
  const std::vector<std::pair<std::string, std::function<void(bool)>>> pedals{
      {"/footpedals/coag",
       [&](bool pressed) {
         joy({now_s(), {pressed}});
       }},
      {"/operator_present", [&](bool pressed) { button({pressed}); }}};
  for (const auto& pedal : pedals) {
    const auto& topic = pedal.first;
    const auto& press = pedal.second;
    SCOPED_TRACE(topic);
    Spy spy(*ears);
    const auto loop = servo(600, "servo.txt", true, {"--operator-present", topic});
    expect_soon_said("hold: operator_absent");
    EXPECT_EQ(spy.count(), 0u);
    ASSERT_TRUE(spy.count_exceeds(300, [&] { press(true); })) << said("servo.txt");
    const double released_s = now_s();
    press(false);
    expect_soon_said("hold: operator_absent", said("servo.txt").rfind("track"));
    sleep(1);
    EXPECT_FALSE(spy.moves_after(released_s + allowed_s + rest_s));
    const std::size_t held = spy.count();
    for (int i = 0; i < 100; ++i) press(true), sleep(0.01);
    EXPECT_EQ(spy.count(), held);
    ASSERT_TRUE(spy.count_exceeds(held + 100, [&] { press(true), command({now_s(), "start"}); })) << said("servo.txt");
    loop->signal(SIGINT);
    loop->wait();
    spy.expect_no_jump();
  }
}

#ifdef LAPSERVO_WEB
TEST_P(FirstWireLoop, ThePageHoldsStartsAndEnds) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  Spy spy(*ears);
  const auto loop = servo(600, "servo.txt", true, {"--web", "0"});
  const int port = page_port();
  ASSERT_TRUE(wait_for([&] { return spy.count() > 300; })) << said("servo.txt");
  EXPECT_EQ(testing::http_status(testing::http_post(port, "/hold")), 202);
  expect_soon_said("hold: held");
  sleep(rest_s + 0.2);
  const double rested_s = now_s();
  sleep(0.5);
  EXPECT_LE(spy.last_s(), rested_s);
  const std::string state = R"("state":"hold: held (by the page: start there))";
  EXPECT_NE(testing::http(port, "GET", "/state").find(state), std::string::npos);
  EXPECT_EQ(testing::http_status(testing::http(port, "GET", "/picture")), 200);
  EXPECT_EQ(testing::http_status(testing::http_post(port, testing::start_path())), 202);
  ASSERT_TRUE(wait_for([&] { return spy.moves_after(rested_s); })) << said("servo.txt");
  EXPECT_EQ(testing::http_status(testing::http_post(port, "/stop")), 202);
  loop->wait();
  EXPECT_NE(said("servo.txt").find("end: requested on the page"), std::string::npos) << said("servo.txt");
}

TEST_P(FirstWireLoop, MovesOnlyWhileThePagesButtonIsPressed) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  Spy spy(*ears);
  const auto loop = servo(600, "servo.txt", true, {"--web", "0", "--operator-present", "page"});
  const int port = page_port();
  expect_soon_said("hold: operator_absent");
  EXPECT_EQ(spy.count(), 0u);
  const auto press = [&] { EXPECT_EQ(testing::http_status(testing::http_post(port, testing::press_path())), 202); };
  const auto start = [&] { EXPECT_EQ(testing::http_status(testing::http_post(port, testing::start_path())), 202); };
  for (const bool says_so : {true, false}) {  // that it is released
    const std::size_t before = spy.count();
    press(), start();
    ASSERT_TRUE(spy.count_exceeds(before + 300, press)) << said("servo.txt");
    const double released_s = now_s();
    if (says_so) testing::http_post(port, "/release");
    expect_soon_said("hold: operator_absent", said("servo.txt").rfind("track"));
    sleep(1);
    const double silent_s = says_so ? 0 : HeldButton::max_age_s;
    EXPECT_FALSE(spy.moves_after(released_s + silent_s + allowed_s + rest_s));
    const std::size_t held = spy.count();
    start();  // without the button it is void, and the button without it does not move
    sleep(0.3);
    for (int i = 0; i < 100; ++i) press(), sleep(0.01);
    EXPECT_EQ(spy.count(), held);
  }
  loop->signal(SIGINT);
  loop->wait();
  spy.expect_no_jump();
}

TEST_P(FirstWireLoop, ThePageEndsTheWaitForAnArm) {
  const auto loop = servo(600, "servo.txt", true, {"--web", "0"});
  const int port = page_port();
  sleep(0.5);
  const double asked_s = now_s();
  EXPECT_EQ(testing::http_status(testing::http_post(port, "/stop")), 202);
  EXPECT_EQ(loop->wait(), 1);
  EXPECT_LT(now_s(), asked_s + 10);
  EXPECT_NE(said("servo.txt").find("end: requested on the page"), std::string::npos) << said("servo.txt");
}

TEST_P(WireLoop, ATopicThatNobodyPublishesEndsWithTheTopicsThatAreThere) {
  const auto room = arm();
  const std::vector<std::string> inputs{
      "--camera", GetParam() + ":/endoscope/image", "--robot", GetParam() + ":PSM1", "--rig", file("rig.yaml"),
      "--out"};
  std::vector<std::unique_ptr<Process>> commands;
  for (const std::string command : {"record", "servo"}) {
    std::vector<std::string> words{command};
    words.insert(words.end(), inputs.begin(), inputs.end());
    words.push_back(file(command));
    commands.push_back(std::make_unique<Process>(words, file(command + ".txt")));
  }
  const std::string types = GetParam() == "ros2" ? "sensor_msgs/msg/" : "sensor_msgs/";
  for (const auto& command : commands) EXPECT_EQ(command->wait(), 1);
  for (const char* output : {"record.txt", "servo.txt"})
    for (const std::string& words :
         {std::string("nobody publishes /endoscope/image; topics that are there: /PSM1/"),
          "/PSM1/measured_js (" + types + "JointState)", "/endoscope/image_raw (" + types + "Image)"})
      EXPECT_NE(said(output).find(words), std::string::npos) << words << " in: " << said(output);
}

#endif

TEST_P(FirstWireLoop, StopsAndStartsAndTakesSetPointsAndTrajectoriesByTopic) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  Spy spy(*ears);
  const auto command = ears->string_publisher("/lapservo/PSM1/command");
  const auto wish = ears->joint_publisher("/lapservo/PSM1/set_point");
  const auto plan = ears->trajectory_publisher("/lapservo/PSM1/trajectory");
  const auto loop = servo(600);
  ASSERT_TRUE(wait_for([&] { return spy.count() > 300; })) << said("servo.txt");
  command({now_s(), "stop"});
  expect_soon_said("hold: held");
  sleep(rest_s + 0.2);
  const double rested_s = now_s();
  sleep(0.5);
  EXPECT_LE(spy.last_s(), rested_s);
  command({now_s(), "start"});
  ASSERT_TRUE(wait_for([&] { return spy.moves_after(rested_s); })) << said("servo.txt");
  const std::vector<std::string> names{"s_rad", "r_px", "l_px", "d_px"};
  const Eigen::Vector4d there = paper_sinusoids().offset;
  wish({now_s(), names, {there[0], 1e6, 200, 100}});
  expect_soon_said("refused: set_point");
  wish({now_s(), names, {there[0], there[1] / 2, there[2] / 2, there[3] / 2}});
  expect_soon_said("a setpoint came");
  sleep(2);
  const Eigen::Vector4d here = {there[0], there[1] / 2, there[2] / 2, there[3] / 2};
  const std::vector<double> begin(here.data(), here.data() + 4), end{here[0], here[1] + 10, here[2], here[3]};
  plan({now_s(), names, {{0, begin}, {0.1, {here[0], 1e6, here[2], here[3]}}}});
  expect_soon_said("refused: trajectory");
  const double planned_s = now_s();
  plan({planned_s, names, {{0, begin}, {0.5, begin}, {1.5, end}}});
  expect_soon_said("a trajectory came");
  sleep(4);
  EXPECT_TRUE(spy.moves_after(planned_s + 0.4));
  loop->signal(SIGINT);
  loop->wait();
  const auto heard = spy.heard();
  EXPECT_LT((heard.back().q - heard[heard.size() - 300].q).cwiseAbs().maxCoeff(), 2e-3);  // it rests there
  spy.expect_no_jump();
}

TEST_P(WireLoop, SurvivesWhenEitherSideIsKilledOrStopped) {
  const auto ears = named_transport(GetParam(), "ears");
  Spy spy(*ears);
  const auto command = ears->string_publisher("/lapservo/PSM1/command");
  auto room = arm();
  auto loop = servo(600);
  ASSERT_TRUE(wait_for([&] { return spy.count() > 300; })) << said("servo.txt");
  double fault_s = now_s();
  room->signal(SIGSTOP);  // as a network that pauses
  sleep(1);
  EXPECT_LE(spy.last_s(), fault_s + allowed_s);
  room->signal(SIGCONT);
  const auto start = [&] { command({now_s(), "start"}); };
  ASSERT_TRUE(spy.count_exceeds(spy.count() + 300, start)) << said("servo.txt");
  fault_s = now_s();
  room->signal(SIGKILL);
  room->wait();
  sleep(0.5);
  EXPECT_LE(spy.last_s(), fault_s + allowed_s);
  room = arm();
  ASSERT_TRUE(spy.count_exceeds(spy.count() + 300, start)) << said("servo.txt");
  loop->signal(SIGKILL);
  loop->wait();
  const auto again = servo(8, "again.txt");
  EXPECT_EQ(again->wait(), 0) << said("again.txt");
}

TEST_P(FirstWireLoop, InterruptedItBringsTheArmToRestAndSaysWhatItCameTo) {
  Arm room(GetParam(), rig_);
  const auto ears = named_transport(GetParam(), "ears");
  for (const int signal : {SIGINT, SIGTERM}) {
    Spy spy(*ears);
    const auto loop = servo(600);
    ASSERT_TRUE(wait_for([&] { return spy.count() > 300; })) << said("servo.txt");
    loop->signal(signal);
    loop->wait();
    spy.expect_braked();
    spy.expect_no_jump();
    EXPECT_NE(said("servo.txt").find("setpoints: "), std::string::npos);
  }
}

TEST_P(FirstWireLoop, WithoutARegistrationItStartsFromTheRcmsImage) {
  Arm room(GetParam(), rig_);
  const Eigen::Vector2d rcm_px =
      projected_rcm_px(rig_.camera, *std::exchange(rig_.instruments[0].camera_from_rcm, std::nullopt)).value();
  testing::write_file(folder_ / "rig.yaml", rig_yaml(rig_));
  const auto loop = servo(600, "servo.txt", true,
                          {"--method", "uncalibrated", "--rcm-px", fmt::format("{},{}", rcm_px[0], rcm_px[1])});
  expect_soon_said("  track");
  loop->signal(SIGINT);
  loop->wait();
}

}  // namespace
}  // namespace lapservo::internal
