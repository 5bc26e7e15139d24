// Conformance with dVRK's own software: PSM1, MTMR with their teleoperation, and ECM in kinematic simulation, over ROS
// 1 (2.3) and ROS 2 (2.4), `lapservo servo` as a process, and an endoscope here that shows the instrument where dVRK
// has it. The tests measure the arm's own joints. LAPSERVO_DVRK=FOLDER names a build: FOLDER/console (2.3) or
// FOLDER/system (2.4) starts it with the arguments that it is given (-j FILE) and runs until it is killed.
// LAPSERVO_DVRK_MINUTES=20 lets the operator work so long.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <numbers>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "lapservo/core/wall_clock.h"
#include "lapservo/crtk/dvrk_frames.h"
#include "lapservo/geometry/rigid3.h"
#include "lapservo/kinematics/feature_map.h"
#include "lapservo/kinematics/rcm_kinematics.h"
#include "lapservo/rig/joint_conversion.h"
#include "lapservo/rig/rig_writer.h"
#include "lapservo/sim_robot/sim_robot.h"
#include "lapservo/testing/process.h"
#include "lapservo/testing/rigs.h"
#include "lapservo/testing/temporary_folder.h"
#include "lapservo/testing/wait_for.h"
#include "transports/named_transport.h"
#include "transports/test_master.h"

namespace lapservo::internal::dvrk_test {
using testing::sleep;
using testing::wait_for;
using SixJoints = Eigen::Matrix<double, 6, 1>;

constexpr double allowed_s = 0.1;  // from an operator's word to the last setpoint
constexpr double steady_s_rad = 0.5e-3, steady_px = 0.5;
constexpr double between_starts_s = 1.6;  // one that is repeated sooner is void
constexpr double fault_step_rad = 0.6;    // beyond what dVRK takes for a tracking error: 20 degrees
constexpr const char* needle_driver = "LARGE_NEEDLE_DRIVER:400006";
const SixJoints homed{{0, 0, 0.12, 0, 0, 0}};
const Eigen::Vector4d view_q(0.05, 1.57, 0.064, 1.2);  // where the endoscope sees the marker

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
        transport.subscribe<JointMessage>("/PSM1/measured_js", [this](JointMessage&& message) { hear(message); }));
    subscriptions_.push_back(transport.subscribe<OperatingStateMessage>(
        "/PSM1/operating_state", [this](OperatingStateMessage&& message) { hear(message); }));
    for (const bool is_ecm : {false, true})
      subscriptions_.push_back(transport.subscribe<PlaceMessage>(
          is_ecm ? "/ECM/local/measured_cp" : "/PSM1/measured_cp", [this, is_ecm](PlaceMessage&& message) {
            const std::lock_guard lock(mutex_);
            (is_ecm ? ecm_ : tip_) = message.pose;
          }));
  }

  std::string text() {
    const std::lock_guard lock(mutex_);
    return fmt::format("{}{}{}, joints {}, {} samples", state_.state, state_.is_homed ? ", homed" : "",
                       state_.is_busy ? ", busy" : "", fmt::join(names_, " "), samples_.size());
  }
  SixJoints joints() {
    const std::lock_guard lock(mutex_);
    return samples_.empty() ? SixJoints::Constant(NAN) : samples_.back().joints;
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
  std::optional<Rigid3> tip() {
    const std::lock_guard lock(mutex_);
    return tip_;
  }
  std::optional<Rigid3> ecm() {
    const std::lock_guard lock(mutex_);
    return ecm_;
  }
  // How ECM has moved the camera since the instrument was registered.
  void register_instrument() {
    const std::lock_guard lock(mutex_);
    registered_ecm_ = ecm_;
  }
  Rigid3 first_camera_from_camera() {
    const std::lock_guard lock(mutex_);
    if (!registered_ecm_) return {};
    return dvrk_from_camera().inverse() * registered_ecm_->inverse() * *ecm_ * dvrk_from_camera();
  }
  bool stands_at(const SixJoints& goal) { return (joints() - goal).cwiseAbs().maxCoeff() < 1e-4; }

  void expect_still_since(double from_s) {
    const std::lock_guard lock(mutex_);
    const auto begin =
        std::find_if(samples_.begin(), samples_.end(), [&](const auto& s) { return s.time_s >= from_s; });
    ASSERT_NE(begin, samples_.end());
    const SixJoints allowed{{1e-4, 1e-4, 0.05e-3, 1e-4, 1e-4, 1e-4}};
    SixJoints moved = SixJoints::Zero();
    for (auto at = begin; at != samples_.end(); ++at) moved = moved.cwiseMax((at->joints - begin->joints).cwiseAbs());
    EXPECT_TRUE((moved.array() <= allowed.array()).all()) << "moved by " << moved.transpose();
  }

 private:
  void hear(const JointMessage& message) {
    if (message.positions.size() < 6) return;
    const std::lock_guard lock(mutex_);
    names_ = message.names;
    samples_.push_back({since_1970_s(), SixJoints(message.positions.data())});
  }
  void hear(const OperatingStateMessage& message) {
    const std::lock_guard lock(mutex_);
    faults_ += message.state == "FAULT" && state_.state != "FAULT";
    state_ = message;
  }

  struct Sample {
    double time_s;
    SixJoints joints;
  };
  std::mutex mutex_;
  std::vector<std::string> names_;
  std::vector<Sample> samples_;
  OperatingStateMessage state_;
  std::optional<Rigid3> tip_, ecm_, registered_ecm_;  // measured_cp of PSM1, local/measured_cp of ECM
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

// Images on /endoscope/image_raw, from where ECM holds the camera; the simulated arm beside them is nobody's.
class EndoscopeOfTheArm {
 public:
  EndoscopeOfTheArm(Transport& transport, const Rig& rig, Judge& judge)
      : simulator_(rig, simulated(), std::make_unique<FollowedArm>(judge)),
        robot_(transport, rig, simulator_, beside()),
        judge_(judge) {
    thread_ = std::thread([this] {
      for (const double begin_s = since_1970_s(); !ended_; sleep(0.002)) {
        follow_ecm();
        robot_.advance(since_1970_s() - begin_s);
      }
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
  void follow_ecm() {
    const Rigid3 now = judge_.first_camera_from_camera();
    const Rigid3 step = first_camera_from_camera_.inverse() * now;
    const Eigen::AngleAxisd turn(step.rotation);
    if (step.translation.norm() < 1e-9 && turn.angle() < 1e-9) return;
    simulator_.move_endoscope({simulator_.now_s(), 0, step.translation, turn.angle() * turn.axis()});
    first_camera_from_camera_ = now;
  }

  Simulator simulator_;
  SimRobot robot_;
  Judge& judge_;
  Rigid3 first_camera_from_camera_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

// Another arm, which an operator enables and homes.
class PoweredArm {
 public:
  PoweredArm(Transport& transport, const std::string& name)
      : name_(name),
        state_command_(transport.publisher<StringMessage>("/" + name + "/state_command")),
        state_(transport.subscribe<OperatingStateMessage>(
            "/" + name + "/operating_state",
            [this](OperatingStateMessage&& message) { ready_ = message.state == "ENABLED" && message.is_homed; })) {}
  void power_on() {
    until(name_, [this] {
      state_command_({since_1970_s(), "enable"});
      sleep(0.5);
      state_command_({since_1970_s(), "home"});
      sleep(0.5);
      return ready_.load();
    });
  }

 private:
  std::string name_;
  Transport::Publisher<StringMessage> state_command_;
  std::atomic<bool> ready_ = false;
  Transport::Subscription state_;
};

// The surgeon's side of the console: MTMR moves PSM1 while the pedal is pressed and the clutch is not.
class Teleoperation {
 public:
  explicit Teleoperation(Transport& transport)
      : mtmr_(transport, "MTMR"),
        move_jp_(transport.publisher<JointMessage>("/MTMR/move_jp")),
        enable_(transport.publisher<BoolMessage>("/console/teleop/enable")),
        pedal_(transport.publisher<JoyMessage>("/console/emulate_operator_present")),
        clutch_(transport.publisher<JoyMessage>("/console/emulate_clutch")) {}
  void power_on() { mtmr_.power_on(); }
  void press() {
    enable_({true});
    pedal_({since_1970_s(), {1}});
  }
  void work_with_clutch_and_release() {
    sleep(0.5);
    for (const double yaw_rad : {0.03, 0.0}) {
      move_jp_({since_1970_s(), {}, {yaw_rad, 0, 0, 0, 0, 0, 0}});
      sleep(1.5);
      clutch_({since_1970_s(), {1}});
      sleep(0.5);
      clutch_({since_1970_s(), {0}});
      sleep(0.5);
    }
    pedal_({since_1970_s(), {0}});
    sleep(0.5);
    enable_({false});
    sleep(0.5);
  }

 private:
  PoweredArm mtmr_;
  Transport::Publisher<JointMessage> move_jp_;
  Transport::Publisher<BoolMessage> enable_;
  Transport::Publisher<JoyMessage> pedal_, clutch_;
};

// The setpoints of the loop.
class Spy {
 public:
  explicit Spy(Transport& transport)
      : subscription_(transport.subscribe<JointMessage>("/PSM1/servo_jp", [this](JointMessage&& message) {
          for (const double position : message.positions) finite_ = finite_ && std::isfinite(position);
          last_s_ = since_1970_s();
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

// By the wire: dVRK 2.3 over ROS 1, dVRK 2.4 over ROS 2.
class Dvrk : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    const char* const folder = std::getenv("LAPSERVO_DVRK");
    const char* const name = is_ros1() ? "console" : "system";
    if (!folder || !std::filesystem::exists(std::filesystem::path(folder) / name))
      GTEST_SKIP() << "not run: LAPSERVO_DVRK names no folder with dVRK's " << name;
    program_ = std::filesystem::absolute(std::filesystem::path(folder) / name).string();
    std::filesystem::current_path(folder_.path());  // dVRK writes its log there
    ::setenv("ROS_LOCALHOST_ONLY", "1", 1);
    if (!std::getenv("ROS_DOMAIN_ID")) ::setenv("ROS_DOMAIN_ID", "89", 1);
    master_ = master_of(GetParam());
    transport_ = named_transport(GetParam(), "operator");
    judge_ = std::make_unique<Judge>(*transport_);
    spy_ = std::make_unique<Spy>(*transport_);
    surgeon_ = std::make_unique<Teleoperation>(*transport_);
    state_command_ = transport_->publisher<StringMessage>("/PSM1/state_command");
    move_jp_ = transport_->publisher<JointMessage>("/PSM1/move_jp");
    servo_jp_ = transport_->publisher<JointMessage>("/PSM1/servo_jp");
    servo_cp_ = transport_->publisher<PlaceMessage>("/PSM1/servo_cp");
    set_base_frame_ = transport_->publisher<PlaceMessage>("/PSM1/set_base_frame");
    ecm_servo_jp_ = transport_->publisher<JointMessage>("/ECM/servo_jp");
    set_tool_type_ = transport_->publisher<TextMessage>("/PSM1/set_tool_type");
    command_ = transport_->publisher<StringMessage>("/lapservo/PSM1/command");
    wish_ = transport_->publisher<JointMessage>("/lapservo/PSM1/set_point");
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

  bool is_ros1() const { return GetParam() == "ros1"; }

  // PSM1 and MTMR with their teleoperation, as files of dVRK 2.3 and 2.4 have them. `of_psm1`: members of its entry;
  // `arms`: entries; each with a comma before it.
  std::string configuration(const std::string& of_psm1, const std::string& arms) const {
    const std::string all =
        R"("arms": [)" +
        arm("PSM1", "PSM", std::string("PSM_KIN_SIMULATED_") + (is_ros1() ? "LARGE_NEEDLE_DRIVER_400006" : "MANUAL"),
            of_psm1) +
        ", " + arm("MTMR", "MTM", "MTMR_KIN_SIMULATED") + arms + "]";
    if (is_ros1())
      return R"({"io": {"physical-footpedals-required": false}, )" + all +
             R"(, "psm-teleops": [{"mtm": "MTMR", "psm": "PSM1", "configure-parameter": {"align-mtm": false, )"
             R"("ignore-jaw": true, "start-gripper-threshold": 0, "start-roll-threshold": 0, "scale": 0.2}}]})";
    return R"({"$id": "dvrk-system.schema.json", "$version": "1", )" + all +
           R"(, "consoles": [{"name": "console", "input_type": "SIMULATED", "teleop_PSMs": [{"MTM": "MTMR", )"
           R"("PSM": "PSM1", "configure_parameter": {"align_MTM": false, "ignore_jaw": true, )"
           R"("start_gripper_threshold": 0, "start_roll_threshold": 0, "scale": 0.2}}]}]})";
  }
  std::string arm(const char* name, const char* type, const std::string& file, const std::string& more = "") const {
    return fmt::format(R"({{"name": "{}", "type": "{}", "simulation": "KINEMATIC", "{}": "arm/{}.json"{}}})", name,
                       type, is_ros1() ? "arm" : "arm_file", file, more);
  }
  std::string ecm(const std::string& more = "") const {
    return ", " + arm("ECM", "ECM", "ECM_KIN_SIMULATED_STRAIGHT", more);
  }
  void start_console(const std::string& of_psm1 = "", const std::string& arms = "") {
    testing::write_file("console.json", configuration(of_psm1, arms));
    console_ = std::make_unique<testing::Process>(
        program_, std::vector<std::string>{"-j", std::filesystem::absolute("console.json").string()}, "console.txt");
    until("the console",
          [&] { return reads("/PSM1/state_command") && reads("/PSM1/move_jp") && judge_->is("DISABLED"); });
    sleep(2);  // its trajectories need the mean of its period: homed at once, it never arrives
  }
  bool reads(const std::string& topic) const { return !transport_->readers(topic).empty(); }
  void start_servo(const std::string& more = "") {
    const std::string limits = (testing::source_folder() / "configs/joint_limits/psm-classic.yaml").string();
    const std::string line = fmt::format(
        "servo --rig rig.yaml --robot {0}:PSM1 --camera {0}:/endoscope/image_raw --fps 30 --set-point {1},{2},{3},{4} "
        "--duration 36000 --enable-motion --joint-limits {5} --setpoint-readers 2 {6}",
        GetParam(), goal_[0], goal_[1], goal_[2], goal_[3], limits, more);
    servo_ = std::make_unique<testing::Process>(LAPSERVO_TOOL, testing::words_of(line), "servo.txt");
  }
  static std::string said() { return testing::read_file("servo.txt"); }
  static void expect_soon_said(const std::string& words, std::size_t after = 0) {
    EXPECT_TRUE(wait_for([&] { return said().find(words, after) != std::string::npos; })) << "no '" << words << "'";
  }

  // --- the operator's words
  void command(const std::string& word) { state_command_({since_1970_s(), word}); }
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
    set_tool_type_({name});
    until("a tool", [&] { return judge_->has_tool() && judge_->is("ENABLED"); });
  }
  void begin_move(const SixJoints& goal) { move_jp_({since_1970_s(), {}, {goal.data(), goal.data() + 6}}); }
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
  void home_ecm() {
    PoweredArm(*transport_, "ECM").power_on();
    ecm_joints_ = {0, 0, 0.12, 0};
    until("ECM at rest", [this] {
      const auto before = judge_->ecm();
      sleep(0.5);
      return before && before->translation.norm() > 0.1 && *judge_->ecm() == *before;
    });
    judge_->register_instrument();
  }
  // From where it is, with the least jerk.
  void move_ecm(
      const Eigen::Vector4d& there, double duration_s, const std::function<void()>& meanwhile = [] {}) {
    const Eigen::Vector4d from = ecm_joints_;
    for (const double begin_s = since_1970_s(); ecm_joints_ != there; sleep(0.01)) {
      const double part = std::min((since_1970_s() - begin_s) / duration_s, 1.0);
      ecm_joints_ = part < 1 ? from + (there - from) * part * part * part * (10 + part * (6 * part - 15)) : there;
      ecm_servo_jp_({since_1970_s(), {}, {ecm_joints_.data(), ecm_joints_.data() + 4}});
      meanwhile();
    }
    const Rigid3 moved = judge_->first_camera_from_camera();
    EXPECT_GT(moved.translation.norm(), 0.008);
    EXPECT_GT(moved.rotation.angularDistance(Eigen::Quaterniond::Identity()), 0.05);
  }
  // --- dVRK's base frame of PSM1
  Instrument instrument() const {
    Instrument instrument = rig_.instruments.front();
    instrument.joints = default_joints();
    return instrument;
  }
  DvrkBase base() const { return dvrk_base(instrument(), {{-0.3, -0.3, 0.1, -1}, {0.3, 0.3, 0.15, 1}}, "rig"); }
  // In dVRK's frame of the camera, soon: to 1e-6 m, and in direction to what dVRK's files round, pi/2 to 1.5708 eight
  // times.
  void expect_tip_on_the_markers_axis(const std::function<void()>& say = [] {}) {
    constexpr double allowed_m = 1e-6, allowed_rad = 8 * (1.5708 - std::numbers::pi / 2);
    double aside_m = INFINITY, askew_rad = INFINITY;
    wait_for([&] {
      say();
      sleep(0.1);
      const auto q = JointVector::from_vector(q_from_joints(default_joints(), judge_->joints().head<4>()));
      const Rigid3 marker = camera_from_marker(instrument().marker, *instrument().camera_from_rcm, q);
      const Rigid3 seen = dvrk_from_camera() * judge_->first_camera_from_camera().inverse() * marker;
      const Rigid3 told = seen.inverse() * judge_->tip().value();
      aside_m = told.translation.head<2>().norm();
      askew_rad = (told.rotation * Eigen::Vector3d::UnitZ()).head<2>().norm();
      return aside_m < allowed_m && askew_rad < allowed_rad;
    });
    EXPECT_LT(aside_m, allowed_m);
    EXPECT_LT(askew_rad, allowed_rad);
  }
  void say_servo_jp(const SixJoints& joints) { servo_jp_({since_1970_s(), {}, {joints.data(), joints.data() + 6}}); }
  void disable_home_and_move_to_view() {
    command("disable");
    wait_for_state("DISABLED");
    home_and_move_to_view();
  }

  // --- the loop's goals
  std::optional<Eigen::Vector4d> features(const Eigen::Vector4d& q) const {
    const Instrument& instrument = rig_.instruments.front();
    const auto found = feature_map(
        {rig_.camera, instrument.marker, judge_->first_camera_from_camera().inverse() * *instrument.camera_from_rcm},
        JointVector::from_vector(q));
    return found ? std::optional(found->f) : std::nullopt;
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
    wish_({since_1970_s(), {"s_rad", "r_px", "l_px", "d_px"}, {goal_[0], goal_[1], goal_[2], goal_[3]}});
    start_until("motion to the other goal", [&] { return (judge_->joints() - before).cwiseAbs().maxCoeff() > 2e-3; });
  }
  // Says start again and again, which is void while it tracks.
  template <typename Condition>
  void start_until(const std::string& what, const Condition& condition) {
    double next_s = since_1970_s() + between_starts_s;
    until(what, [&] {
      if (since_1970_s() > next_s) command_({since_1970_s(), "start"}), next_s = since_1970_s() + between_starts_s;
      return condition();
    });
  }
  void start_until_at_goal() {
    command_({since_1970_s(), "start"});
    start_until("the goal", [&] { return at_goal(); });
  }
  void expect_steady(double duration_s) {
    sleep(1.5);
    Eigen::Array4d squares = Eigen::Array4d::Zero();
    int count = 0;
    for (const double end_s = since_1970_s() + duration_s; since_1970_s() < end_s; sleep(0.01), ++count)
      squares += error().array().square();
    const Eigen::Array4d rms = (squares / count).sqrt();
    worst_rms_ = worst_rms_.max(rms);
    EXPECT_LE(rms[0], steady_s_rad);
    EXPECT_LE(rms.tail<3>().maxCoeff(), steady_px) << rms.transpose();
  }
  // Nothing comes from the loop and, when nobody else moves it, no joint moves.
  void expect_held(double duration_s) {
    const double from_s = since_1970_s();
    const long count = spy_->count();
    sleep(duration_s);
    judge_->expect_still_since(from_s);
    EXPECT_EQ(spy_->count(), count);
  }
  void expect_held_until_a_start() {
    expect_held(1);
    EXPECT_EQ(judge_->faults(), operators_faults_);
    start_until_at_goal();
    expect_steady(1);
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
  std::shared_ptr<void> master_;
  std::unique_ptr<Transport> transport_;
  std::unique_ptr<Judge> judge_;
  std::unique_ptr<Spy> spy_;
  std::unique_ptr<Teleoperation> surgeon_;
  Transport::Publisher<StringMessage> state_command_, command_;
  Transport::Publisher<JointMessage> move_jp_, servo_jp_, ecm_servo_jp_, wish_;
  Transport::Publisher<PlaceMessage> servo_cp_, set_base_frame_;
  Transport::Publisher<TextMessage> set_tool_type_;
  Rig rig_;
  std::unique_ptr<EndoscopeOfTheArm> endoscope_;
  std::unique_ptr<testing::Process> console_, servo_;
  Eigen::Vector4d goal_ = Eigen::Vector4d::Zero();
  Eigen::Array4d worst_rms_ = Eigen::Array4d::Zero();
  double worst_late_s_ = 0;
  int goals_ = 0, operators_faults_ = 0;
  Eigen::Vector4d ecm_joints_ = Eigen::Vector4d::Zero();

  struct Event {
    const char* name;
    std::function<void()> act, recover;
    bool arm_rests;  // nobody moves the arm until it recovers
  };
  std::vector<Event> events();
  void go_through(const Event& event);
};

std::vector<Dvrk::Event> Dvrk::events() {
  const Rigid3 here = judge_->tip().value();
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
         for (int i = 0; i < 100; ++i) servo_cp_({since_1970_s(), "", here}), sleep(0.01);
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
  const double acted_s = since_1970_s();
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
TEST_P(Dvrk, AnOperatorsWordHoldsTheLoopUntilAStart) {
  const char* const minutes = std::getenv("LAPSERVO_DVRK_MINUTES");
  const double end_s = since_1970_s() + 60 * (minutes ? std::atof(minutes) : 0);
  work_until_at_goal();
  surgeon_->power_on();
  const auto all = events();
  std::size_t words = 0;
  for (; (words < all.size() || since_1970_s() < end_s) && !HasFatalFailure(); ++words)
    go_through(all[words % all.size()]);
  EXPECT_TRUE(spy_->all_finite());
  std::printf("%zu words; steady to %.2f mrad, %.2f px; last setpoint %.0f ms after a word\n", words,
              worst_rms_[0] * 1e3, worst_rms_.tail<3>().maxCoeff(), worst_late_s_ * 1e3);
}

TEST_P(Dvrk, WithoutAToolItSaysSoAndAToolThatIsChangedHolds) {
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
  const double named_s = since_1970_s();
  set_tool("MARYLAND_DISSECTOR:400143");
  expect_soon_said("hold: ", said().rfind("  track"));
  const long held = spy_->count();
  EXPECT_LE(spy_->last_s() - named_s, allowed_s);
  sleep(1);
  EXPECT_EQ(spy_->count(), held);
  EXPECT_EQ(judge_->faults(), 0);
}

TEST_P(Dvrk, AConsoleThatIsKilledAndStartedAgainIsNotMovedUntilAStart) {
  work_until_at_goal();
  wish_the_other_goal();
  const double killed_s = since_1970_s();
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

// As calibrate registration --set-base-frame publishes it.
TEST_P(Dvrk, AfterSetBaseFrameMeasuredCpLiesOnTheMarkersAxis) {
  start_console();
  home_and_move_to_view();
  const Rigid3 base_frame = dvrk_from_camera() * base().camera_from_base;
  expect_tip_on_the_markers_axis([&] { set_base_frame_({since_1970_s(), "camera", base_frame}); });
  move(view() + SixJoints{{0.1, -0.1, 0.01, 0.3, 0, 0}});
  expect_tip_on_the_markers_axis();
}

// As --base-frame writes it.
TEST_P(Dvrk, WithABaseFrameInItsFileMeasuredCpLiesOnTheMarkersAxis) {
  const std::string json = dvrk_base_frame_json(base().camera_from_base, "camera");
  const std::size_t begin = json.find('{') + 1, end = json.rfind('}');
  std::string member = ", " + json.substr(begin, end - begin);
  if (is_ros1()) std::replace(member.begin(), member.end(), '_', '-');
  start_console(member);
  home_and_move_to_view();
  expect_tip_on_the_markers_axis();
}

// As --endoscope with --base-frame writes it: also after ECM moved the camera.
TEST_P(Dvrk, WithSujFixedMeasuredCpLiesOnTheMarkersAxisInACameraThatEcmMoves) {
  if (is_ros1()) GTEST_SKIP() << "not run: dVRK 2.3 has other files of SUJ_Fixed";
  const auto file_of = [](const std::string& psm1) {
    const std::string others = R"("measured_cp": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]})";
    std::string arms = psm1;
    for (const char* const name : {"ECM", "PSM2", "PSM3"}) arms += fmt::format(R"(, {{"name": "{}", )", name) + others;
    testing::write_file("suj.json", R"({"arms": [)" + arms + "]}");
  };
  const auto base_of = [](const char* name) {
    return fmt::format(R"(, "base_frame": {{"component": "SUJ", "interface": "{}"}})", name);
  };
  const std::string suj = fmt::format(R"(, {{"name": "SUJ", "type": "SUJ_Fixed", "arm_file": "{}"}})",
                                      std::filesystem::absolute("suj.json").string());
  const auto begin = [&] {
    start_console(base_of("PSM1"), ecm(base_of("ECM")) + suj);
    home_and_move_to_view();
    home_ecm();
  };
  file_of(dvrk_suj_fixed_json({}, "PSM1", {}));
  begin();
  const std::string psm1 = dvrk_suj_fixed_json(base().camera_from_base, "PSM1", judge_->ecm().value());
  console_.reset();
  file_of(psm1);
  begin();
  expect_tip_on_the_markers_axis();
  move_ecm({0.05, 0.03, 0.13, 0.05}, 2);
  expect_tip_on_the_markers_axis();
}

// Smoothly within 4 s, while the loop holds the instrument's place in the image.
TEST_P(Dvrk, TracksWhileEcmMovesTheCamera) {
  start_console("", ecm());
  home_and_move_to_view();
  home_ecm();
  start_servo(fmt::format("--endoscope {}:ECM", GetParam()));
  start_until_at_goal();
  expect_steady(1);

  const std::size_t before = said().size();
  Eigen::Array4d worst = Eigen::Array4d::Zero();
  move_ecm({0.05, 0.03, 0.13, 0.05}, 4, [&] { worst = worst.max(error().array().abs()); });
  EXPECT_LE(worst.tail<3>().maxCoeff(), 3);
  EXPECT_EQ(said().find("hold: ", before), std::string::npos) << said();
  worst_rms_.setZero();
  expect_steady(1);
  const Rigid3 moved = judge_->first_camera_from_camera();
  std::printf("ECM by %.2f rad, %.0f mm: at most %.2f mrad, %.2f px off meanwhile, %.2f mrad, %.2f px rms after\n",
              moved.rotation.angularDistance(Eigen::Quaterniond::Identity()), moved.translation.norm() * 1e3,
              worst[0] * 1e3, worst.tail<3>().maxCoeff(), worst_rms_[0] * 1e3, worst_rms_.tail<3>().maxCoeff());
}

INSTANTIATE_TEST_SUITE_P(Over, Dvrk, ::testing::ValuesIn(named_transports()),
                         [](const auto& wire) { return wire.param; });

}  // namespace lapservo::internal::dvrk_test
