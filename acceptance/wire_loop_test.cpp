// The closed loop through ROS 2's wire and ROS 1's: `lapservo servo` as a process of its own steers an arm in another
// process or in this one, over loopback. Assertions use the stamps of messages and counts, not the speed of this
// computer; waits end early.

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "lapservo/control/paper_trajectory.h"
#include "lapservo/core/wall_clock.h"
#include "lapservo/crtk/dvrk_frames.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/sim_robot/sim_robot.h"
#include "lapservo/testing/process.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/wait_for.h"
#include "transports/named_transport.h"
#include "transports/test_master.h"
#ifdef LAPSERVO_WEB
#include "web/test_http.h"
#endif

namespace lapservo::internal::wire_loop_test {
using testing::sleep;
using testing::wait_for;

constexpr double allowed_s = 0.1;  // from a fault to the last setpoint
constexpr double tick_s = 1.0 / 500;
const JointLimits limits;  // those of the file, but for rounded positions
const double rest_s = (limits.rate.cwiseQuotient(limits.acceleration)).maxCoeff();

// The tool with the arguments of a line, its output in a file; killed with the object.
struct Process : testing::Process {
  Process(const std::string& arguments, const std::string& output)
      : testing::Process(LAPSERVO_TOOL, testing::words_of(arguments), output) {}
};

// The setpoints that any listener on the arm's topics receives.
class Spy {
 public:
  explicit Spy(Transport& transport)
      : subscription_(transport.subscribe<JointMessage>("/PSM1/servo_jp", [this](JointMessage&& message) {
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

// An arm in this process, that can be made to misbehave.
class Arm {
 public:
  Arm(const std::string& transport, const Rig& rig)
      : transport_(named_transport(transport, "arm")),
        simulator_(rig, simulated(), {0.05, 1.57, 0.064, 1.2}),
        robot_(*transport_, rig, simulator_, config()) {
    thread_ = std::thread([this] {
      const double begin_s = since_1970_s();
      double paused_s = 0;
      while (!ended_) {
        sleep(0.001);
        if (silent) {
          paused_s = since_1970_s() - begin_s - simulator_.now_s();
        } else {
          robot_.advance(since_1970_s() - begin_s - paused_s);
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
    };
    config.alter_image = [this](ImageMessage& message) {
      if (frozen) message.stamp_s = last_stamp_s_;
      last_stamp_s_ = message.stamp_s;
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

// Section V-D as the half-size camera sees it, and that camera's rig.
class WireLoop : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    ::setenv("ROS_LOCALHOST_ONLY", "1", 1);
    if (!std::getenv("ROS_DOMAIN_ID")) ::setenv("ROS_DOMAIN_ID", "88", 1);
    master_ = master_of(GetParam());
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
  std::string file(const std::string& name) const { return (folder_ / name).string(); }
  std::string said(const std::string& name = "servo.txt") const { return testing::read_file(folder_ / name); }
  void expect_said(const std::string& words, const std::string& name = "servo.txt") const {
    EXPECT_NE(said(name).find(words), std::string::npos) << "no '" << words << "' in: " << said(name);
  }
  // By the loop, after its first so many letters.
  void expect_soon_said(const std::string& words, std::size_t after = 0) const {
    wait_for([&] { return said().find(words, after) != std::string::npos; });
    EXPECT_NE(said().find(words, after), std::string::npos) << "no '" << words << "' in: " << said();
  }
  // By the tool, which ends with this exit code.
  void expect_ends(const std::string& arguments, int code, const std::string& words) const {
    Process tool(arguments, file("tool.txt"));
    EXPECT_EQ(tool.wait(), code) << said("tool.txt");
    expect_said(words, "tool.txt");
  }

  std::unique_ptr<Process> servo(double duration_s, const std::string& more = "", bool motion = true) const {
    std::string line = fmt::format(
        "servo --rig {} --trajectory {} --robot {}:PSM1 --camera {}:/endoscope/image_raw --fps 30 --duration {} ",
        file("rig.yaml"), file("v-d.csv"), GetParam(), GetParam(), duration_s);
    if (motion)
      line += fmt::format("--enable-motion --joint-limits {} --setpoint-readers {} ", file("limits.yaml"),
                          setpoint_readers_);
    std::filesystem::remove(file("servo.txt"));  // that of a loop before would be read
    return std::make_unique<Process>(line + more, file("servo.txt"));
  }
  std::string sim_robot() const {
    return fmt::format("sim-robot --rig {} --start 0.05,1.57,0.064,1.2 --transport {}", file("rig.yaml"), GetParam());
  }
  std::unique_ptr<Process> arm() const {
    return std::make_unique<Process>(sim_robot() + " --arm PSM1", file("arm.txt"));
  }
  // New ears of this process, and a voice.
  void listen() {
    if (!ears_) ears_ = named_transport(GetParam(), "ears");
    command_ = ears_->publisher<StringMessage>("/lapservo/PSM1/command");
    spy_.reset();
    spy_ = std::make_unique<Spy>(*ears_);
  }
  // An arm in this process, and a loop beside it.
  void begin(const std::string& more = "") {
    if (!room_) room_ = std::make_unique<Arm>(GetParam(), rig_);
    listen();
    loop_ = servo(600, more);
  }
  // So many more setpoints soon; says something meanwhile.
  ::testing::AssertionResult moves(
      std::size_t more = 300, const std::function<void()>& say = [] {}) {
    const std::size_t before = spy_->count();
    const bool moved = wait_for([&] { return say(), spy_->count() > before + more; });
    return moved ? ::testing::AssertionSuccess() : ::testing::AssertionFailure() << said();
  }
  // At most every two seconds: a start that is repeated does not count.
  void start() {
    constexpr double between_s = 2;
    if (since_1970_s() - started_s_ < between_s) return;
    started_s_ = since_1970_s();
    command_({started_s_, "start"});
  }
  void expect_to_rest_until(const std::function<void()>& start) {
    sleep(rest_s + 0.2);
    const double rested_s = since_1970_s();
    sleep(0.5);
    EXPECT_LE(spy_->last_s(), rested_s);
    start();
    EXPECT_TRUE(wait_for([&] { return spy_->moves_after(rested_s); })) << said();
  }
  void end(int signal = SIGINT) {
    loop_->signal(signal);
    loop_->wait();
  }
  // Where servo says that its page is; 0 when it does not say it.
  int page_port() const {
    const std::string before = "page: http://127.0.0.1:";
    std::size_t at = std::string::npos;
    wait_for([&] { return (at = said().find(before)) != std::string::npos; });
    return at == std::string::npos ? 0 : std::stoi(said().substr(at + before.size()));
  }
  Rig rig_;
  testing::TemporaryFolder folder_;
  int setpoint_readers_ = 2;  // the arm and this process's ears
  std::shared_ptr<void> master_;
  std::unique_ptr<Arm> room_;
  std::unique_ptr<Transport> ears_;
  Transport::Publisher<StringMessage> command_;
  double started_s_ = 0;
  std::unique_ptr<Spy> spy_;
  std::unique_ptr<Process> loop_;
};
// Code that all wires share is tested on the first one only: it is in real time.
class FirstWireLoop : public WireLoop {};
INSTANTIATE_TEST_SUITE_P(Over, WireLoop, ::testing::ValuesIn(named_transports()),
                         [](const auto& wire) { return wire.param; });
INSTANTIATE_TEST_SUITE_P(Over, FirstWireLoop, ::testing::Values(named_transports().front()),
                         [](const auto& wire) { return wire.param; });

TEST_P(WireLoop, ASimulatedArmHasANameOfItsOwnAndRefusesOneThatIsTaken) {
  const std::string command = sim_robot() + " --duration 1";
  expect_ends(command, 0, "arm SIM_PSM1, ");
  const Arm room(GetParam(), rig_);
  expect_ends(command + " --arm PSM1", 2, "--arm: is PSM1, where an arm is already");
}

// By half a radian within two seconds.
TEST_P(FirstWireLoop, TheTipStaysWhileTheWristMovesByItself) {
  Tool& tool = rig_.instruments[0].tool.emplace();
  tool.wrist = {{.name = "wrist_pitch", .alpha_rad = -1.57, .theta_rad = -1.57},
                {.name = "wrist_yaw", .alpha_rad = -1.57, .a_m = 0.009, .theta_rad = -1.57}};
  tool.last_from_tip.translation = {0, 0.01, 0};
  tool.place.emplace().base_in_marker_m = {0, 0, 0.04};
  testing::write_file(folder_ / "rig.yaml", rig_yaml(rig_));
  const Rigid3 camera_from_marker = lapservo::camera_from_marker(
      rig_.instruments[0].marker, *rig_.instruments[0].camera_from_rcm, {0.05, 1.57, 0.064, 1.2});
  const Eigen::Vector3d goal_m =
      camera_from_marker * tip_in_marker(tool, std::array{0.1, -0.2}).marker_from_tip.translation;
  std::string csv = "time_s,x_m,y_m,z_m\n";
  for (int k = 0; k < 20; ++k) csv += fmt::format("{},{},{},{}\n", k, goal_m.x() + 0.002, goal_m.y(), goal_m.z());
  testing::write_file(folder_ / "v-d.csv", csv);
  const Process room(sim_robot() + " --arm PSM1 --swing-wrist 0.5", file("arm.txt"));
  const auto loop = servo(10);
  EXPECT_EQ(loop->wait(), 0) << said() << said("arm.txt");
  const std::string text = said(), before = "; the seen tip ";
  const std::size_t at = text.find(before);
  ASSERT_NE(at, std::string::npos) << text;
  EXPECT_LE(std::stod(text.substr(at + before.size())), 0.5) << text;
}

TEST_P(WireLoop, TrackPublishesFrames) {
  const auto room = arm();
  listen();
  Process track(fmt::format("track {}:/endoscope/image_raw --rig {} --out {} --publish {} --tf-frames c,r,NAME_m,s",
                            GetParam(), file("rig.yaml"), file("seen.csv"), GetParam()),
                file("track.txt"));
  const std::string msg = GetParam() == "ros2" ? "/msg/" : "/";
  for (const auto& [topic, package, type] : {std::array<std::string, 3>{"/tf", "tf2_msgs", "TFMessage"},
                                             {"/tf_static", "tf2_msgs", "TFMessage"},
                                             {"/lapservo/PSM1/pose", "geometry_msgs", "PoseWithCovarianceStamped"},
                                             {"/lapservo/PSM1/markers", "visualization_msgs", "MarkerArray"}}) {
    wait_for([&, name = topic] { return ears_->published().contains(name); });
    EXPECT_EQ(ears_->published()[topic], package + msg + type) << said("track.txt");
  }
  track.signal(SIGINT);
  EXPECT_EQ(track.wait(), 0) << said("track.txt");
}

// An arm holds it, and rests; held while its poses don't come.
TEST_P(WireLoop, GoesOnBesideAnArmThatHoldsTheEndoscope) {
  listen();
  std::atomic<bool> tells = true, ended = false;
  const auto ecm = ears_->publisher<PlaceMessage>("/ECM/local/measured_cp");
  std::thread arm([&] {
    for (; !ended; sleep(0.01))
      if (tells) ecm({since_1970_s(), "ECM_base", {Eigen::Quaterniond(0.6, 0, 0.8, 0), {0.1, 0, 0.2}}});
  });
  begin("--endoscope " + GetParam() + ":ECM");
  EXPECT_TRUE(moves());
  tells = false;
  expect_soon_said("stale_image");
  tells = true;
  EXPECT_TRUE(moves(100, [&] { start(); }));
  end();
  ended = true;
  arm.join();
}

TEST_P(FirstWireLoop, ObservesOnlyWithoutEnableMotion) {
  const Arm room(GetParam(), rig_);
  listen();
  servo(3, "", false)->wait();
  EXPECT_EQ(spy_->count(), 0u);
  expect_said("would send outer_yaw ");
}

struct Fault {
  const char* name;
  std::function<void(Arm&, bool on)> set;
  const char* said;
  bool silent;  // no setpoint is sent any more; else they come to rest
};

TEST_P(FirstWireLoop, HoldsAtAFaultWithin100MillisecondsAndGoesOnAfterAStartWithoutAJump) {
  const auto state = [](OperatingState faulty) {
    return [faulty](Arm& a, bool on) { a.robot().set_state(on ? faulty : OperatingState::enabled); };
  };
  const std::vector<Fault> faults{
      {"NaN", [](Arm& a, bool on) { a.nan = on; }, "non_finite_joints", true},
      {"PAUSED", state(OperatingState::paused), "the arm is PAUSED", true},
      {"FAULT", state(OperatingState::fault), "the arm is FAULT", true},
      {"silence", [](Arm& a, bool on) { a.silent = on; }, "old_joint_states", true},
      {"repeated stamps", [](Arm& a, bool on) { a.frozen = on; }, "stale_image", false},
      {"the same image", [](Arm& a, bool on) { a.stuck = on; }, "frozen_image", false},
      {"no image", [](Arm& a, bool on) { a.blind = on; }, "stale_image", false},
  };
  begin();
  for (const Fault& fault : faults) {
    SCOPED_TRACE(fault.name);
    ASSERT_TRUE(moves(500));
    const std::size_t said_before = said().size();
    const double fault_s = since_1970_s();
    fault.set(*room_, true);
    expect_soon_said(fault.said, said_before);
    sleep(1);
    if (fault.silent) {
      EXPECT_LE(spy_->last_s(), fault_s + allowed_s + rest_s);  // an arm that still listens is braked
    } else {
      // The loop's period and the age of what it sees come on top of the limit, and braking.
      EXPECT_FALSE(spy_->moves_after(fault_s + allowed_s + 2.0 / 30 + rest_s));
    }
    const std::size_t held = spy_->count();
    fault.set(*room_, false);
    sleep(0.7);
    if (fault.silent) {
      EXPECT_EQ(spy_->count(), held);
    }
    ASSERT_TRUE(moves(100, [&] { start(); }));
  }
  spy_->expect_no_jump();
  EXPECT_EQ(room_->robot().statistics().malformed, 0);
  EXPECT_EQ(room_->robot().statistics().wrist_moved, 0);
  end();
}

TEST_P(FirstWireLoop, RecordsAnArmThatItMovesAndCalibratesFromIt) {
  const auto room = arm();
  // A new user's rig: names alone. As it counts phi, the arm stands far beyond where instruments go.
  Rig blank = rig_;
  blank.instruments[0].joints = Joints{default_joints().names, {1, 1, 1, 1}, {}};
  testing::write_file(folder_ / "blank.yaml", rig_yaml(blank));
  const std::string swing = "new.yaml.recordings/turn";  // as calibrate all names it
  const auto recording = [&](const std::string& into) {
    return fmt::format(
        "record --rig {} --camera {}:/endoscope/image_raw --robot {}:PSM1 --out {} --fps 15 --move swing --scale 0.5 "
        "--duration 10",
        file("blank.yaml"), GetParam(), GetParam(), file(into));
  };
  const auto moving = [&](const std::string& into, const std::string& limits_file = "limits.yaml") {
    return recording(into) + " --enable-motion --setpoint-readers 2 --joint-limits " + file(limits_file);
  };
  expect_ends(recording(swing), 2, "--enable-motion");
  expect_ends(recording(swing) + " --enable-motion", 2, "--joint-limits");
  listen();
  // Pitch stands near a limit, as the arm reads it: said before anything moves.
  testing::write_file(folder_ / "cramped.yaml",
                      "lower: [-1, -1, 0.01, -4]\nupper: [1, 0.03, 0.2, 4]\n"
                      "rate: [0.4, 0.4, 0.04, 1.5]\nacceleration: [2, 2, 0.2, 7.5]\n");
  expect_ends(moving("cramped", "cramped.yaml"), 1, "the arm was not moved: outer_pitch would move by 0.0");
  EXPECT_EQ(spy_->count(), 0U);

  expect_ends(moving(swing), 0, "outer_pitch moved by 0.2");
  expect_ends(
      fmt::format("calibrate registration {} --rig {} --out {}", file(swing), file("blank.yaml"), file("new.yaml")), 0,
      "");
  const Instrument measured = load_rig(file("new.yaml")).instruments[0];
  EXPECT_EQ(measured.joints->sign, default_joints().sign);
  constexpr double joint_error_rad = 0.035;  // the simulated arm's own
  EXPECT_NEAR(measured.joints->offset[1], default_joints().offset[1] - joint_error_rad, 4e-3);
  const Rigid3 moved = rig_.instruments[0].camera_from_rcm->inverse() * *measured.camera_from_rcm;
  EXPECT_LT(moved.translation.norm(), 0.5e-3) << said("tool.txt");

  // It is no recording of another arm.
  expect_ends(fmt::format("calibrate all --rig {0} --camera {1}:/endoscope/image_raw --robot {1}:PSM2",
                          file("new.yaml"), GetParam()),
              2, "holds /PSM1/measured_js, expected /PSM2/measured_js of --robot: rename");

  // The same for dVRK: published for a resting endoscope, and as a file for one that an ECM holds.
  std::optional<PlaceMessage> base_frame;
  std::mutex mutex;
  const auto subscription = ears_->subscribe<PlaceMessage>("/PSM1/set_base_frame", [&](PlaceMessage&& message) {
    const std::lock_guard lock(mutex);
    base_frame = message;
  });
  const std::string calibrate = fmt::format("calibrate registration {} --rig {} --out {} --base-frame {} ", file(swing),
                                            file("new.yaml"), file("again.yaml"), file("base.json"));
  expect_ends(calibrate + "--set-base-frame " + GetParam() + ":PSM1", 0, "published on /PSM1/set_base_frame");
  ASSERT_TRUE(wait_for([&] {
    const std::lock_guard lock(mutex);
    return base_frame.has_value();
  }));
  const Rigid3 dvrk_from_rcm = dvrk_from_camera() * *load_rig(file("again.yaml")).instruments[0].camera_from_rcm;
  {
    const std::lock_guard lock(mutex);
    EXPECT_LT((base_frame->pose.translation - dvrk_from_rcm.translation).norm(), 1e-9);
  }
  EXPECT_NE(said("base.json").find("\"base_frame\""), std::string::npos) << said("base.json");
  const auto ecm = ears_->publisher<PlaceMessage>("/ECM/local/measured_cp");
  Process held(calibrate + "--endoscope " + GetParam() + ":ECM", file("held.txt"));
  wait_for([&] {
    return ecm({since_1970_s(), "ECM_base", {}}), said("base.json").find("\"name\"") != std::string::npos;
  });
  EXPECT_EQ(held.wait(), 0) << said("held.txt");
  EXPECT_NE(said("base.json").find("\"name\": \"PSM1\""), std::string::npos) << said("base.json");

  // Interrupted on its way it brakes, and keeps what it has.
  Process interrupted(moving("part"), file("interrupted.txt"));
  const double begun_s = since_1970_s();
  ASSERT_TRUE(wait_for([&] { return spy_->moves_after(begun_s); })) << said("interrupted.txt");
  sleep(3);
  interrupted.signal(SIGINT);
  EXPECT_EQ(interrupted.wait(), 1);
  expect_said("stopped before the motion ended", "interrupted.txt");
  EXPECT_TRUE(std::filesystem::exists(file("part") + "/metadata.yaml"));
  spy_->expect_braked();
  spy_->expect_no_jump();
}

TEST_P(WireLoop, ASecondPublisherIsNoticedWithin100MillisecondsAndHoldsUntilAStart) {
  const auto foreign = named_transport(GetParam(), "foreign");
  const auto say = foreign->publisher<JointMessage>("/PSM1/servo_jp");
  begin();
  ASSERT_TRUE(moves());
  const double first_s = since_1970_s();
  const Eigen::Vector4d elsewhere(0.02, 0, 0.08, 1);
  const Eigen::Vector4d theirs = q_from_joints(default_joints(), elsewhere);
  EXPECT_TRUE(wait_for([&] {
    say({since_1970_s(), {}, {elsewhere[0], elsewhere[1], elsewhere[2], elsewhere[3], 0.1, -0.2}});
    return said().find("foreign_command") != std::string::npos;
  }));
  sleep(1.5);
  double last_s = 0;
  for (const Spy::SetPoint& set_point : spy_->heard())
    if (!set_point.q.isApprox(theirs, 1e-9)) last_s = set_point.stamp_s;
  EXPECT_GT(last_s, 0);
  EXPECT_LE(last_s, first_s + allowed_s);
  ASSERT_TRUE(moves(300, [&] { start(); }));
  end();
}

TEST_P(WireLoop, MovesOnlyWhileTheOperatorPressesAPedalOfEitherType) {
  const auto pedals = named_transport(GetParam(), "pedals");
  const auto joy = pedals->publisher<JoyMessage>("/footpedals/coag");
  const auto button = pedals->publisher<BoolMessage>("/operator_present");
  for (const bool is_joy : {true, false}) {
    const std::string topic = is_joy ? "/footpedals/coag" : "/operator_present";
    SCOPED_TRACE(topic);
    const auto set = [&](bool pressed) { is_joy ? joy({since_1970_s(), {pressed}}) : button({pressed}); };
    const auto press = [&] { set(true); };
    begin("--operator-present " + topic);
    expect_soon_said("hold: operator_absent");
    EXPECT_EQ(spy_->count(), 0u);
    ASSERT_TRUE(moves(300, press));
    const double released_s = since_1970_s();
    set(false);
    expect_soon_said("hold: operator_absent", said().rfind("track"));
    sleep(1);
    EXPECT_FALSE(spy_->moves_after(released_s + allowed_s + rest_s));
    const std::size_t held = spy_->count();
    for (int i = 0; i < 100; ++i) press(), sleep(0.01);
    EXPECT_EQ(spy_->count(), held) << "pressed again, it waits for a start";
    ASSERT_TRUE(moves(100, [&] { press(), start(); }));
    end();
    spy_->expect_no_jump();
  }
}

#ifdef LAPSERVO_WEB
int posted(int port, const std::string& path) {
  return testing::http_status(testing::http_post(port, path));
}

TEST_P(FirstWireLoop, ThePageHoldsStartsAndEnds) {
  loop_ = servo(600, "--web 0");  // before there is an arm
  const int first_port = page_port();
  sleep(0.5);
  const double asked_s = since_1970_s();
  EXPECT_EQ(posted(first_port, "/stop"), 202);
  EXPECT_EQ(loop_->wait(), 1);
  EXPECT_LT(since_1970_s(), asked_s + 10);
  expect_said("end: requested on the page");
  begin("--web 0");
  const int port = page_port();
  ASSERT_TRUE(moves());
  EXPECT_EQ(posted(port, "/hold"), 202);
  expect_soon_said("hold: held");
  expect_to_rest_until([&] {
    const std::string state = R"("state":"hold: held (by the page: start there, or with force))";
    EXPECT_NE(testing::http(port, "GET", "/state").find(state), std::string::npos);
    EXPECT_EQ(testing::http_status(testing::http(port, "GET", "/picture")), 200);
    EXPECT_EQ(posted(port, testing::start_path()), 202);
  });
  EXPECT_EQ(posted(port, "/stop"), 202);
  loop_->wait();
  expect_said("end: requested on the page");
  begin("--web 0 --control topics");
  ASSERT_TRUE(moves(100));
  EXPECT_EQ(posted(page_port(), testing::start_path()), 403);
  end();
}

#endif

TEST_P(WireLoop, ATopicThatNobodyPublishesEndsWithTheTopicsThatAreThere) {
  const auto room = arm();
  std::vector<std::unique_ptr<Process>> commands;
  for (const std::string command : {"record", "servo"})
    commands.push_back(
        std::make_unique<Process>(fmt::format("{} --camera {}:/endoscope/image --robot {}:PSM1 --rig {} --out {}",
                                              command, GetParam(), GetParam(), file("rig.yaml"), file(command)),
                                  file(command + ".txt")));
  const std::string types = GetParam() == "ros2" ? "sensor_msgs/msg/" : "sensor_msgs/";
  for (const auto& command : commands) EXPECT_EQ(command->wait(), 1);
  for (const char* output : {"record.txt", "servo.txt"})
    for (const std::string& words :
         {std::string("nobody publishes /endoscope/image; topics that are there: /PSM1/"),
          "/PSM1/measured_js (" + types + "JointState)", "/endoscope/image_raw (" + types + "Image)"})
      expect_said(words, output);
}

TEST_P(FirstWireLoop, StopsAndStartsAndTakesSetPointsAndTrajectoriesByTopic) {
  begin();
  const auto wish = ears_->publisher<JointMessage>("/lapservo/PSM1/set_point");
  const auto plan = ears_->publisher<TrajectoryMessage>("/lapservo/PSM1/trajectory");
  ASSERT_TRUE(moves());
  command_({since_1970_s(), "stop"});
  expect_soon_said("hold: held");
  expect_to_rest_until([&] { start(); });
  const std::vector<std::string> names{"s_rad", "r_px", "l_px", "d_px"};
  const Eigen::Vector4d there = paper_sinusoids().offset;
  wish({since_1970_s(), names, {there[0], 1e6, 200, 100}});
  expect_soon_said("refused: set_point");
  const Eigen::Vector4d here = {there[0], there[1] / 2, there[2] / 2, there[3] / 2};
  const std::vector<double> begin(here.data(), here.data() + 4), end_there{here[0], here[1] + 10, here[2], here[3]};
  wish({since_1970_s(), names, begin});
  expect_soon_said("a setpoint came");
  sleep(2);
  plan({since_1970_s(), names, {{0, begin}, {0.1, {here[0], 1e6, here[2], here[3]}}}});
  expect_soon_said("refused: trajectory");
  const double planned_s = since_1970_s();
  plan({planned_s, names, {{0, begin}, {0.5, begin}, {1.5, end_there}}});
  expect_soon_said("a trajectory came");
  sleep(4);
  EXPECT_TRUE(spy_->moves_after(planned_s + 0.4));
  end();
  const auto heard = spy_->heard();
  EXPECT_LT((heard.back().q - heard[heard.size() - 300].q).cwiseAbs().maxCoeff(), 2e-3);  // it rests there
  spy_->expect_no_jump();
}

TEST_P(WireLoop, ALoopThatHungNeedsAStart) {
  const std::size_t on_its_way = GetParam() == "ros1";  // docs/known-issues.md: over ROS 1 one may be
  begin();
  ASSERT_TRUE(moves(500));
  for (const double hung_s : {0.7, 3.0}) {
    loop_->signal(SIGSTOP);
    const double stopped_s = since_1970_s();
    sleep(hung_s);
    const std::size_t before = spy_->count(), said_before = said().size();
    loop_->signal(SIGCONT);
    expect_soon_said("loop_late", said_before);
    sleep(1);
    EXPECT_LE(spy_->last_s(), stopped_s + allowed_s);
    EXPECT_LE(spy_->count(), before + on_its_way);
    ASSERT_TRUE(moves(300, [&] { start(); }));
  }
  end();
}

TEST_P(WireLoop, SurvivesWhenEitherSideIsKilledOrStopped) {
  listen();
  auto room = arm();
  loop_ = servo(600);
  ASSERT_TRUE(moves());
  double fault_s = since_1970_s();
  room->signal(SIGSTOP);  // as a network that pauses
  sleep(1);
  EXPECT_LE(spy_->last_s(), fault_s + allowed_s + rest_s);
  room->signal(SIGCONT);
  ASSERT_TRUE(moves(300, [&] { start(); }));
  fault_s = since_1970_s();
  room->signal(SIGKILL);
  room->wait();
  sleep(0.5);
  EXPECT_LE(spy_->last_s(), fault_s + allowed_s + rest_s);
  room = arm();
  expect_soon_said("restarted");
  ASSERT_TRUE(moves(300, [&] { start(); }));
  end(SIGKILL);
  EXPECT_EQ(servo(8)->wait(), 0) << said();
}

TEST_P(FirstWireLoop, InterruptedItBringsTheArmToRestAndSaysWhatItCameTo) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    begin();
    ASSERT_TRUE(moves());
    end(signal);
    spy_->expect_braked();
    spy_->expect_no_jump();
    expect_said("setpoints: ");
  }
}

TEST_P(FirstWireLoop, WithoutARegistrationItStartsFromTheRcmsImage) {
  const Arm room(GetParam(), rig_);
  const Eigen::Vector2d rcm_px =
      projected_rcm_px(rig_.camera, *std::exchange(rig_.instruments[0].camera_from_rcm, std::nullopt)).value();
  testing::write_file(folder_ / "rig.yaml", rig_yaml(rig_));
  loop_ = servo(600, fmt::format("--method uncalibrated --rcm-px {},{}", rcm_px[0], rcm_px[1]));
  expect_soon_said("  track");
  end();
}

}  // namespace lapservo::internal::wire_loop_test
