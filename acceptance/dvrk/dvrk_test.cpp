// Conformance with dVRK's own software: its console with PSM1, MTMR and their teleoperation in kinematic simulation,
// over ROS 1, `lapservo servo` as a process, and an endoscope here that shows the instrument where the console has it.
// The tests measure the arm's own joints. LAPSERVO_DVRK=FOLDER names a build: FOLDER/console starts the console with
// the arguments that it is given (-j FILE) and runs until it is killed. LAPSERVO_DVRK_MINUTES=20 lets the operator work
// so long.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <geometry_msgs/PoseStamped.h>
#include <memory>
#include <mutex>
#include <optional>
#include <ros/ros.h>
#include <std_msgs/String.h>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "lapservo/kinematics/feature_map.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/sim_robot/sim_robot.h"
#include "lapservo/testing/process.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/wait_for.h"
#include "transports/ros1/ros1_messages.h"
#include "transports/ros1/ros1_transport.h"
#include "transports/ros1/test_ros_master.h"

namespace lapservo::internal {
namespace {
using testing::wait_for;
using SixJoints = Eigen::Matrix<double, 6, 1>;
using Text = std_msgs::String_<Ros1Allocator<std::byte>>;
using Pose = geometry_msgs::PoseStamped_<Ros1Allocator<std::byte>>;

constexpr double allowed_s = 0.1;  // from an operator's word to the last setpoint
constexpr double steady_s_rad = 0.5e-3, steady_px = 0.5;
constexpr double fault_step_rad = 0.6;  // beyond what dVRK takes for a tracking error: 20 degrees
constexpr const char* needle_driver = "LARGE_NEEDLE_DRIVER:400006";
const SixJoints homed{{0, 0, 0.12, 0, 0, 0}};
const Eigen::Vector4d view_q(0.05, 1.57, 0.064, 1.2);  // where the endoscope sees the marker

double now_s() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}
void sleep(double duration_s) {
  std::this_thread::sleep_for(std::chrono::duration<double>(duration_s));
}

// Ends a test that can't go on without this condition.
template <typename Condition>
void until(const std::string& what, const Condition& condition) {
  if (!wait_for(condition)) throw std::runtime_error("not within a minute: " + what);
}

// The arm's states as dVRK publishes them.
class Judge {
 public:
  explicit Judge(Transport& transport) {
    subscriptions_.push_back(
        transport.subscribe_joints("/PSM1/measured_js", [this](JointMessage&& message) { hear(message); }));
    subscriptions_.push_back(transport.subscribe_operating_state(
        "/PSM1/operating_state", [this](OperatingStateMessage&& message) { hear(message); }));
  }

  struct Sample {
    double time_s;
    SixJoints joints;
  };
  std::string text() {
    const std::lock_guard lock(mutex_);
    return fmt::format("{}{}{}, joints {}, {} samples", state_.state, state_.is_homed ? ", homed" : "",
                       state_.is_busy ? ", busy" : "", fmt::join(names_, " "), samples_.size());
  }
  SixJoints joints() {
    const std::lock_guard lock(mutex_);
    return samples_.empty() ? SixJoints::Constant(NAN) : samples_.back().joints;
  }
  std::vector<Sample> samples(double from_s, double to_s = INFINITY) {
    const std::lock_guard lock(mutex_);
    std::vector<Sample> some;
    for (const Sample& sample : samples_)
      if (from_s <= sample.time_s && sample.time_s <= to_s) some.push_back(sample);
    return some;
  }
  // Without a tool, the actuators of the sterile adapter are joints, too.
  bool has_tool() {
    const std::lock_guard lock(mutex_);
    return names_.size() == 6;
  }
  bool is(const std::string& state, bool busy = false) {
    const std::lock_guard lock(mutex_);
    return state_.state == state && state_.is_busy == busy;
  }
  int faults() {
    const std::lock_guard lock(mutex_);
    return faults_;
  }
  // Where the instrument is: not quite where the encoders say.
  Eigen::Vector4d true_q() {
    const SixJoints here = joints();
    const Eigen::Vector4d q = here.hasNaN() ? view_q : q_from_joints(default_joints(), here.head<4>());
    return q + ArmConfig().joint_offset;
  }
  bool stands_at(const SixJoints& goal) { return (joints() - goal).cwiseAbs().maxCoeff() < 1e-4; }

  void expect_still_since(double from_s) {
    const auto some = samples(from_s);
    ASSERT_FALSE(some.empty());
    const SixJoints allowed{{1e-4, 1e-4, 0.05e-3, 1e-4, 1e-4, 1e-4}};
    SixJoints moved = SixJoints::Zero();
    for (const Sample& sample : some) moved = moved.cwiseMax((sample.joints - some.front().joints).cwiseAbs());
    EXPECT_TRUE((moved.array() <= allowed.array()).all()) << "moved by " << moved.transpose();
  }

 private:
  void hear(const JointMessage& message) {
    if (message.positions.size() < 6) return;
    const std::lock_guard lock(mutex_);
    names_ = message.names;
    samples_.push_back({now_s(), SixJoints(message.positions.data())});
  }
  void hear(const OperatingStateMessage& message) {
    const std::lock_guard lock(mutex_);
    faults_ += message.state == "FAULT" && state_.state != "FAULT";
    state_ = message;
  }

  std::mutex mutex_;
  std::vector<std::string> names_;
  std::vector<Sample> samples_;
  OperatingStateMessage state_;
  int faults_ = 0;
  std::vector<Transport::Subscription> subscriptions_;
};

// The endoscope's instrument, at the joints that dVRK publishes.
class FollowedArm : public SimulatedArm {
 public:
  explicit FollowedArm(Judge& judge) : judge_(judge) {}
  void servo_jp(const Eigen::Vector4d&) override {}
  void step(double) override {}
  Eigen::Vector4d measured_jp() const override { return judge_.true_q(); }
  Eigen::Vector4d true_jp() const override { return judge_.true_q(); }
  bool faulted() const override { return false; }
  void fault() override {}
  void recover() override {}

 private:
  Judge& judge_;
};

// Images on /endoscope/image_raw; the simulated arm beside them is nobody's.
class EndoscopeOfTheArm {
 public:
  EndoscopeOfTheArm(Transport& transport, const Rig& rig, Judge& judge)
      : simulator_(rig, simulated(), std::make_unique<FollowedArm>(judge)),
        robot_(transport, rig, simulator_, beside()) {
    thread_ = std::thread([this] {
      for (const double begin_s = now_s(); !ended_; sleep(0.002)) robot_.advance(now_s() - begin_s);
    });
  }
  ~EndoscopeOfTheArm() {
    ended_ = true;
    thread_.join();
  }
  EndoscopeOfTheArm(const EndoscopeOfTheArm&) = delete;
  EndoscopeOfTheArm& operator=(const EndoscopeOfTheArm&) = delete;

 private:
  static SimulatorConfig simulated() {
    SimulatorConfig config;
    config.endoscope.frame_rate_hz = 30;
    config.endoscope.real_time = true;
    config.endoscope.render_threads = 1;
    return config;
  }
  static SimRobotConfig beside() {
    SimRobotConfig config;
    config.arm = "ENDOSCOPE";
    config.joint_rate_hz = 1;
    return config;
  }

  Simulator simulator_;
  SimRobot robot_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

// The surgeon's side of the console: MTMR moves PSM1 while the pedal is pressed and the clutch is not.
class Teleoperation {
 public:
  explicit Teleoperation(Transport& transport)
      : state_command_(transport.string_publisher("/MTMR/state_command")),
        move_jp_(transport.joint_publisher("/MTMR/move_jp")),
        enable_(transport.bool_publisher("/console/teleop/enable")),
        pedal_(transport.joy_publisher("/console/emulate_operator_present")),
        clutch_(transport.joy_publisher("/console/emulate_clutch")),
        state_(transport.subscribe_operating_state("/MTMR/operating_state", [this](OperatingStateMessage&& message) {
          ready_ = message.state == "ENABLED" && message.is_homed;
        })) {}
  static const char* configuration() {
    return R"("psm-teleops": [{"mtm": "MTMR", "psm": "PSM1", "configure-parameter": {"align-mtm": false, )"
           R"("ignore-jaw": true, "start-gripper-threshold": 0, "start-roll-threshold": 0, "scale": 0.2}}])";
  }
  void power_on() {
    until("MTMR", [this] {
      state_command_({now_s(), "enable"});
      sleep(0.5);
      state_command_({now_s(), "home"});
      sleep(0.5);
      return ready_.load();
    });
  }
  void press() {
    enable_({true});
    pedal_({now_s(), {1}});
  }
  void work_with_clutch_and_release() {
    sleep(0.5);
    for (const double yaw_rad : {0.03, 0.0}) {
      move_jp_({now_s(), {}, {yaw_rad, 0, 0, 0, 0, 0, 0}});
      sleep(1.5);
      clutch_({now_s(), {1}});
      sleep(0.5);
      clutch_({now_s(), {0}});
      sleep(0.5);
    }
    pedal_({now_s(), {0}});
    sleep(0.5);
    enable_({false});
    sleep(0.5);
  }

 private:
  Transport::Publisher<StringMessage> state_command_;
  Transport::Publisher<JointMessage> move_jp_;
  Transport::Publisher<BoolMessage> enable_;
  Transport::Publisher<JoyMessage> pedal_, clutch_;
  std::atomic<bool> ready_ = false;
  Transport::Subscription state_;
};

// The setpoints of the loop.
class Spy {
 public:
  explicit Spy(Transport& transport)
      : subscription_(transport.subscribe_joints("/PSM1/servo_jp", [this](JointMessage&& message) {
          for (const double position : message.positions) finite_ = finite_ && std::isfinite(position);
          last_s_ = now_s();
          ++count_;
        })) {}
  long count() const { return count_; }
  double last_s() const { return last_s_; }
  bool all_finite() const { return finite_; }

 private:
  std::atomic<long> count_ = 0;
  std::atomic<double> last_s_ = 0;
  std::atomic<bool> finite_ = true;
  Transport::Subscription subscription_;
};

class Dvrk : public ::testing::Test {
 protected:
  void SetUp() override {
    const char* const folder = std::getenv("LAPSERVO_DVRK");
    if (!folder || !std::filesystem::exists(std::filesystem::path(folder) / "console"))
      GTEST_SKIP() << "not run: LAPSERVO_DVRK names no build of dVRK's software";
    program_ = std::filesystem::absolute(std::filesystem::path(folder) / "console").string();
    std::filesystem::current_path(folder_.path());  // the console writes its log there
    master_ = std::make_unique<TestRosMaster>();
    transport_ = std::make_unique<Ros1Transport>("operator");
    node_ = std::make_unique<ros::NodeHandle>();
    judge_ = std::make_unique<Judge>(*transport_);
    spy_ = std::make_unique<Spy>(*transport_);
    surgeon_ = std::make_unique<Teleoperation>(*transport_);
    state_command_ = transport_->string_publisher("/PSM1/state_command");
    move_jp_ = transport_->joint_publisher("/PSM1/move_jp");
    servo_jp_ = transport_->joint_publisher("/PSM1/servo_jp");
    servo_cp_ = node_->advertise<Pose>("/PSM1/servo_cp", 1);
    set_tool_type_ = node_->advertise<Text>("/PSM1/set_tool_type", 1);
    command_ = transport_->string_publisher("/lapservo/PSM1/command");
    wish_ = transport_->joint_publisher("/lapservo/PSM1/set_point");
    rig_ = testing::small_test_rig();
    endoscope_ = std::make_unique<EndoscopeOfTheArm>(*transport_, rig_, *judge_);
    testing::write_file("rig.yaml", rig_yaml(rig_));
    goal_ = goal(0);
  }
  void TearDown() override {
    servo_.reset();
    console_.reset();
    endoscope_.reset();
    if (HasFailure()) std::printf("the arm: %s\n", judge_->text().c_str());
    if (HasFailure())
      for (const char* const name : {"servo.txt", "console.txt"})
        std::printf("%s:\n%s\n", name, testing::read_file(name).c_str());
    std::filesystem::current_path("/");
  }

  void start_console() {
    testing::write_file("console.json", R"({"io": {"physical-footpedals-required": false}, "arms": [)"
                                        R"({"name": "PSM1", "type": "PSM", "simulation": "KINEMATIC", )"
                                        R"("arm": "arm/PSM_KIN_SIMULATED_LARGE_NEEDLE_DRIVER_400006.json"}, )"
                                        R"({"name": "MTMR", "type": "MTM", "simulation": "KINEMATIC", )"
                                        R"("arm": "arm/MTMR_KIN_SIMULATED.json"}], )" +
                                            std::string(Teleoperation::configuration()) + "}");
    console_ = std::make_unique<testing::Process>(
        program_, std::vector<std::string>{"-j", std::filesystem::absolute("console.json").string()}, "console.txt");
    until("the console",
          [&] { return reads("/PSM1/state_command") && reads("/PSM1/move_jp") && judge_->is("DISABLED"); });
    sleep(2);  // its trajectories need the mean of its period: homed at once, it never arrives
  }
  bool reads(const std::string& topic) const { return !transport_->readers(topic).empty(); }
  void start_servo(const std::string& limits = "") {
    const std::string psm = (testing::source_folder() / "configs/joint_limits/psm-classic.yaml").string();
    const std::string line = fmt::format(
        "servo --rig rig.yaml --robot ros1:PSM1 --camera ros1:/endoscope/image_raw --fps 30 --set-point {},{},{},{} "
        "--duration 36000 --enable-motion --joint-limits {} --setpoint-readers 2",
        goal_[0], goal_[1], goal_[2], goal_[3], limits.empty() ? psm : limits);
    servo_ = std::make_unique<testing::Process>(LAPSERVO_TOOL, testing::words_of(line), "servo.txt");
  }
  static std::string said() { return testing::read_file("servo.txt"); }
  static void expect_soon_said(const std::string& words, std::size_t after = 0) {
    EXPECT_TRUE(wait_for([&] { return said().find(words, after) != std::string::npos; })) << "no '" << words << "'";
  }

  // --- the operator's words
  void command(const std::string& word) { state_command_({now_s(), word}); }
  void wait_for_state(const std::string& state) {
    until(state, [&] { return judge_->is(state); });
  }
  void wait_for_rest_at(const char* what, const SixJoints& goal) {
    until(what, [&] { return judge_->stands_at(goal) && judge_->is("ENABLED"); });
    sleep(0.3);
  }
  void enable_and_home() {
    command("enable");
    wait_for_state("ENABLED");
    command("home");
    wait_for_rest_at("homed", homed);
  }
  // A simulated arm has none before.
  void set_tool(const std::string& name) {
    Text message;
    message.data = name;
    until("reader of set_tool_type", [&] { return set_tool_type_.getNumSubscribers() > 0; });
    set_tool_type_.publish(message);
    until("a tool", [&] { return judge_->has_tool() && judge_->is("ENABLED"); });
  }
  void begin_move(const SixJoints& goal) { move_jp_({now_s(), {}, {goal.data(), goal.data() + 6}}); }
  void move(const SixJoints& goal) {
    begin_move(goal);
    wait_for_rest_at("the operator's goal", goal);
  }
  void home_and_move_to_view() {
    enable_and_home();
    if (!judge_->has_tool()) set_tool(needle_driver);
    move(view());
  }
  static SixJoints view() {
    SixJoints joints = SixJoints::Zero();
    joints.head<4>() = joints_from_q(default_joints(), view_q);
    return joints;
  }
  void say_servo_jp(const SixJoints& joints) { servo_jp_({now_s(), {}, {joints.data(), joints.data() + 6}}); }
  void disable_home_and_move_to_view() {
    command("disable");
    wait_for_state("DISABLED");
    home_and_move_to_view();
  }

  // --- the loop's goals
  std::optional<Eigen::Vector4d> features(const Eigen::Vector4d& q) const {
    const Instrument& instrument = rig_.instruments.front();
    const auto found =
        feature_map({rig_.camera, instrument.marker, *instrument.camera_from_rcm}, JointVector::from_vector(q));
    return found.point ? std::optional(found.point->f) : std::nullopt;
  }
  // Two goals on section V-D's way, as the half-size camera sees it.
  static Eigen::Vector4d goal(int number) {
    const Eigen::Vector4d middle(0.9, 397.5, 182.5, 106), away(0.04, 20, 8, 10);
    return middle + (number % 2 == 0 ? 1 : -1) * away;
  }
  Eigen::Vector4d error() {
    const auto here = features(judge_->true_q());
    return here ? Eigen::Vector4d(*here - goal_) : Eigen::Vector4d::Constant(INFINITY);
  }
  bool at_goal() {
    const Eigen::Array4d off = error().array().abs();
    return off[0] <= steady_s_rad && off.tail<3>().maxCoeff() <= steady_px;
  }
  // It moves away for a while.
  void wish_the_other_goal() {
    goal_ = goal(++goals_);
    const SixJoints before = judge_->joints();
    wish_({now_s(), {"s_rad", "r_px", "l_px", "d_px"}, {goal_[0], goal_[1], goal_[2], goal_[3]}});
    start_until("motion to the other goal", [&] { return (judge_->joints() - before).cwiseAbs().maxCoeff() > 2e-3; });
  }
  // Says start again and again, which is void while it tracks.
  template <typename Condition>
  void start_until(const std::string& what, const Condition& condition) {
    double next_s = now_s() + 1;
    until(what, [&] {
      if (now_s() > next_s) command_({now_s(), "start"}), next_s = now_s() + 1;
      return condition();
    });
  }
  void start_until_at_goal() {
    command_({now_s(), "start"});
    start_until("the goal", [&] { return at_goal(); });
  }
  void expect_steady(double duration_s) {
    sleep(1.5);
    Eigen::Array4d squares = Eigen::Array4d::Zero();
    int count = 0;
    for (const double end_s = now_s() + duration_s; now_s() < end_s; sleep(0.01), ++count)
      squares += error().array().square();
    const Eigen::Array4d rms = (squares / count).sqrt();
    worst_rms_ = worst_rms_.max(rms);
    EXPECT_LE(rms[0], steady_s_rad);
    EXPECT_LE(rms.tail<3>().maxCoeff(), steady_px) << rms.transpose();
  }
  // Nothing comes from the loop and, when nobody else moves it, no joint moves.
  void expect_held(double duration_s) {
    const double from_s = now_s();
    const long count = spy_->count();
    sleep(duration_s);
    judge_->expect_still_since(from_s);
    EXPECT_EQ(spy_->count(), count);
  }
  void expect_held_until_a_start(double steady_s = 1) {
    expect_held(1);
    EXPECT_EQ(judge_->faults(), operators_faults_);
    start_until_at_goal();
    expect_steady(steady_s);
  }
  void work_until_at_goal() {
    start_console();
    home_and_move_to_view();
    start_servo();
    start_until_at_goal();
    sleep(0.5);
  }

  testing::TemporaryFolder folder_;
  std::string program_;
  std::unique_ptr<TestRosMaster> master_;
  std::unique_ptr<Ros1Transport> transport_;
  std::unique_ptr<ros::NodeHandle> node_;
  std::unique_ptr<Judge> judge_;
  std::unique_ptr<Spy> spy_;
  std::unique_ptr<Teleoperation> surgeon_;
  Transport::Publisher<StringMessage> state_command_, command_;
  Transport::Publisher<JointMessage> move_jp_, servo_jp_, wish_;
  ros::Publisher set_tool_type_, servo_cp_;
  Rig rig_;
  std::unique_ptr<EndoscopeOfTheArm> endoscope_;
  std::unique_ptr<testing::Process> console_, servo_;
  Eigen::Vector4d goal_ = Eigen::Vector4d::Zero();
  Eigen::Array4d worst_rms_ = Eigen::Array4d::Zero();
  double worst_late_s_ = 0;
  int goals_ = 0, operators_faults_ = 0;

  struct Event {
    const char* name;
    std::function<void()> act, recover;
    bool arm_rests;  // nobody moves the arm until it recovers
  };
  std::vector<Event> events();
  void go_through(const Event& event);
};

std::vector<Dvrk::Event> Dvrk::events() {
  const auto here = ros::topic::waitForMessage<Pose>("/PSM1/measured_cp", *node_);
  const SixJoints elsewhere = view() + SixJoints{{0.05, 0.03, 0.005, 0.2, 0.1, -0.1}};
  return {
      {"pause", [this] { command("pause"); },
       [this] {
         command("resume");
         wait_for_state("ENABLED");
       },
       true},
      // A setpoint on its way ends the motion, often: said again while the loop is held, it arrives.
      {"move_jp, busy", [this, elsewhere] { begin_move(elsewhere); }, [this, elsewhere] { move(elsewhere); }, false},
      {"disable, home", [this] { command("disable"); }, [this] { disable_home_and_move_to_view(); }, false},
      {"another client of servo_jp",
       [this] {
         SixJoints joints = judge_->joints();
         for (int i = 0; i < 100; ++i) joints[0] += 2e-4, say_servo_jp(joints), sleep(0.01);
       },
       [] {}, false},
      {"another client of servo_cp",
       [this, here] {
         for (int i = 0; i < 100; ++i) servo_cp_.publish(*here), sleep(0.01);
       },
       [] {}, false},
      {"fault",
       [this] {
         ++operators_faults_;
         // The last of several setpoints within a millisecond counts: again until it was.
         const SixJoints start = judge_->joints();
         const SixJoints there = start + SixJoints::Unit(0) * fault_step_rad;
         for (bool away = true; !judge_->is("FAULT"); away = !away) say_servo_jp(away ? there : start), sleep(0.01);
       },
       [this] { disable_home_and_move_to_view(); }, false},
      {"teleoperation", [this] { surgeon_->press(); }, [this] { surgeon_->work_with_clutch_and_release(); }, false},
      {"unhome", [this] { command("unhome"); }, [this] { disable_home_and_move_to_view(); }, false},
  };
}

// While the arm moves to a goal: held within 100 ms, still after it recovers and until a start.
void Dvrk::go_through(const Event& event) {
  SCOPED_TRACE(event.name);
  wish_the_other_goal();
  const double acted_s = now_s();
  event.act();
  expect_soon_said("hold: ", said().rfind("  track"));
  const double silent_s = spy_->last_s();
  sleep(0.3);
  const long held = spy_->count();
  worst_late_s_ = std::max(worst_late_s_, silent_s - acted_s);
  EXPECT_LE(spy_->last_s() - acted_s, allowed_s);
  if (event.arm_rests) judge_->expect_still_since(acted_s + allowed_s);
  event.recover();
  EXPECT_EQ(spy_->count(), held) << "something was sent while it was held";
  expect_held_until_a_start();
}

// Each of the words, and again for LAPSERVO_DVRK_MINUTES.
TEST_F(Dvrk, AnOperatorsWordHoldsTheLoopUntilAStart) {
  const char* const minutes = std::getenv("LAPSERVO_DVRK_MINUTES");
  const double end_s = now_s() + 60 * (minutes ? std::atof(minutes) : 0);
  work_until_at_goal();
  surgeon_->power_on();
  const auto all = events();
  std::size_t words = 0;
  for (; (words < all.size() || now_s() < end_s) && !HasFatalFailure(); ++words) go_through(all[words % all.size()]);
  EXPECT_TRUE(spy_->all_finite());
  std::printf("%zu words; steady to %.2f mrad, %.2f px; last setpoint %.0f ms after a word\n", words,
              worst_rms_[0] * 1e3, worst_rms_.tail<3>().maxCoeff(), worst_late_s_ * 1e3);
}

TEST_F(Dvrk, ConnectsBeforePowerOnAndLetsTheOperatorHome) {
  start_servo();
  start_console();
  sleep(1);
  home_and_move_to_view();
  EXPECT_EQ(spy_->count(), 0);
  expect_held_until_a_start(2);
}

TEST_F(Dvrk, AnArmThatIsEnabledAndNotHomedIsNotHijacked) {
  work_until_at_goal();
  command("disable");
  wait_for_state("DISABLED");
  command("enable");
  wait_for_state("ENABLED");
  const double enabled_s = now_s();
  while (now_s() < enabled_s + 2) command_({now_s(), "start"}), sleep(0.01);
  command("home");
  wait_for_rest_at("homed", homed);
  move(view());
  expect_held_until_a_start();
}

TEST_F(Dvrk, WithoutAToolItSaysSoAndAToolThatIsChangedHolds) {
  start_console();
  start_servo();
  enable_and_home();
  EXPECT_FALSE(judge_->has_tool());
  expect_soon_said("set_tool_type");
  EXPECT_EQ(spy_->count(), 0);
  set_tool(needle_driver);
  move(view());
  expect_held_until_a_start();

  // Named in the midst of it, another tool makes the console disable the arm.
  wish_the_other_goal();
  const double named_s = now_s();
  set_tool("MARYLAND_DISSECTOR:400143");
  expect_soon_said("hold: ", said().rfind("  track"));
  const long held = spy_->count();
  EXPECT_LE(spy_->last_s() - named_s, allowed_s);
  sleep(1);
  EXPECT_EQ(spy_->count(), held);
  EXPECT_EQ(judge_->faults(), 0);
}

// A NaN in servo_jp makes the console disable the arm; the loop sends none.
TEST_F(Dvrk, SendsNoNaNAndIsHeldWhenAnotherClientDoes) {
  work_until_at_goal();
  const std::size_t before = said().size();
  wish_({now_s(), {"s_rad", "r_px", "l_px", "d_px"}, {NAN, goal_[1], goal_[2], goal_[3]}});
  sleep(1);
  EXPECT_TRUE(judge_->is("ENABLED"));
  EXPECT_EQ(said().find("hold: ", before), std::string::npos) << said();
  // The last of several setpoints within a millisecond counts: again until it was.
  until("DISABLED", [this] {
    say_servo_jp(SixJoints::Constant(NAN));
    return judge_->is("DISABLED");
  });
  disable_home_and_move_to_view();
  expect_held_until_a_start();
  EXPECT_TRUE(spy_->all_finite());
}

TEST_F(Dvrk, AConsoleThatIsKilledAndStartedAgainIsNotMovedUntilAStart) {
  work_until_at_goal();
  wish_the_other_goal();
  const double killed_s = now_s();
  console_->signal(SIGKILL);
  console_->wait();
  sleep(1);
  EXPECT_LE(spy_->last_s() - killed_s, allowed_s);
  const long held = spy_->count();
  start_console();
  home_and_move_to_view();
  EXPECT_EQ(spy_->count(), held);
  expect_held_until_a_start();
}

TEST_F(Dvrk, KeepsToItsRatesAndRefusesGoalsBeyondItsLimits) {
  const std::string rest = "rate: [0.1, 0.1, 0.01, 0.4]\nacceleration: [0.5, 0.5, 0.05, 2]\n";
  testing::write_file("narrow.yaml", "lower: [-1, -0.9, 0.0795, 1.19]\nupper: [1, 0.9, 0.0797, 1.21]\n" + rest);
  testing::write_file("slow.yaml", "lower: [-1, -0.9, 0.04, -4]\nupper: [1, 0.9, 0.2, 4]\n" + rest);
  start_console();
  home_and_move_to_view();
  start_servo("narrow.yaml");
  EXPECT_EQ(servo_->wait(), 2);
  EXPECT_NE(said().find("can't be followed"), std::string::npos) << said();
  EXPECT_EQ(spy_->count(), 0);

  const double moved_s = now_s();
  start_servo("slow.yaml");
  start_until_at_goal();
  const Eigen::Array4d rate(0.1, 0.1, 0.01, 0.4);
  const auto samples = judge_->samples(moved_s);
  constexpr std::size_t apart = 10;
  for (std::size_t i = apart; i < samples.size(); ++i) {
    const Eigen::Array4d step = (samples[i].joints - samples[i - apart].joints).head<4>().cwiseAbs();
    const double passed_s = samples[i].time_s - samples[i - apart].time_s + 0.02;  // they arrive irregularly
    EXPECT_TRUE((step <= rate * passed_s).all()) << step.transpose() << " in " << passed_s;
  }
}

}  // namespace
}  // namespace lapservo::internal
