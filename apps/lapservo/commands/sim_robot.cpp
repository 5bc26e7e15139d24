#include "lapservo/sim_robot/sim_robot.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/random_start.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/robot/steady_clock.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"

namespace lapservo::app {
using namespace internal;
namespace {

struct SimRobotOptions {
  std::string rig, transport = "ros2", arm = "SIM_PSM1", camera = "/endoscope";
  std::vector<double> start;
  double latency_ms = 80, fps = 30, duration_s = 0, swing_wrist_rad = 0;
  std::uint64_t seed = 1;
};

// Where the paper's trajectory can be followed from, unless said.
JointVector start_of(const SimRobotOptions& options, const Rig& rig, const ArmConfig& arm) {
  if (!options.start.empty()) return JointVector::from_vector(Eigen::Vector4d(options.start.data()));
  constexpr double margin_px = 20, duration_s = 20;
  ControllerConfig controller;
  controller.window = image_window(rig.camera, margin_px);
  Random random(options.seed);
  return random_start(sinusoids(paper_sinusoids()), duration_s, feature_model(rig), controller, arm.joint_offset,
                      random, "the paper's trajectory, which --start replaces");
}

// Whoever steers an arm of that name would steer both.
void refuse_taken_name(Transport& transport, const SimRobotConfig& config, const std::string& arm) {
  constexpr double listen_s = 2;  // until whoever is there has been found
  std::atomic<bool> heard = false;
  const auto joints =
      transport.subscribe<JointMessage>(topic_of(config.arm, "measured_js"), [&](JointMessage&&) { heard = true; });
  const auto states = transport.subscribe<OperatingStateMessage>(topic_of(config.arm, "operating_state"),
                                                                 [&](OperatingStateMessage&&) { heard = true; });
  if (wait_until([&] { return heard.load(); }, listen_s))
    throw InputError("--arm", "is " + arm + ", where an arm is already, expected a name of its own");
}

// Those that come with the rigs of configs/, wherever these are.
std::string joint_limits_beside(const std::string& rig) {
  constexpr auto usual = "joint_limits/psm-classic.yaml";
  const std::filesystem::path beside = std::filesystem::path(rig).parent_path() / usual;
  return std::filesystem::exists(beside) ? beside.string() : std::string("configs/") + usual;
}

int run(const SimRobotOptions& options) {
  if (options.rig.empty())
    throw InputError("--rig", "is missing, expected a rig's YAML, for example configs/paper.yaml");
  const Rig rig = single_instrument(load_rig(options.rig), options.rig);
  SimulatorConfig simulated;
  simulated.seed = options.seed;
  simulated.endoscope.latency_s = options.latency_ms / 1000;
  simulated.endoscope.frame_rate_hz = options.fps;
  simulated.endoscope.real_time = true;
  simulated.wrist_swing_rad = options.swing_wrist_rad;
  Simulator simulator(rig, simulated, start_of(options, rig, simulated.arm));
  const auto transport = make_transport(options.transport, "lapservo_sim_robot", "--transport");
  SimRobotConfig config;
  config.arm = resolved_name({options.transport, options.arm}, "--arm");
  config.camera = resolved_name({options.transport, options.camera}, "--camera");
  watch_for_interrupts();
  refuse_taken_name(*transport, config, options.arm);
  SimRobot robot(*transport, rig, simulator, config);
  std::printf(
      "arm %s, camera %s/image_raw and image_raw/compressed; lapservo servo --rig %s --robot %s:%s --camera "
      "%s:%s/image_raw ",
      options.arm.c_str(), options.camera.c_str(), options.rig.c_str(), options.transport.c_str(), options.arm.c_str(),
      options.transport.c_str(), options.camera.c_str());
  const std::string& instrument = rig.instruments.front().name;
  if (options.arm != instrument && options.arm != "SIM_" + instrument)
    std::printf("--instrument %s ", instrument.c_str());
  std::printf("--enable-motion --joint-limits %s moves it, Ctrl-C ends this\n",
              joint_limits_beside(options.rig).c_str());
  if (const Joints usual = default_joints(); !rig.instruments.front().joints)
    fmt::print(
        "{} has no joints, which servo needs: add to its instrument `joints: {{names: [{}], sign: [{}], offset: "
        "[{}]}}`\n",
        options.rig, fmt::join(usual.names, ", "), fmt::join(usual.sign, ", "), fmt::join(usual.offset, ", "));
  std::fflush(stdout);
  SteadyClock clock;
  const double begin_s = clock.now_s();
  double time_s = 0;
  while (!interrupted() && (options.duration_s == 0 || time_s < options.duration_s)) {
    time_s = clock.now_s() - begin_s;
    robot.advance(time_s);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  std::printf("%ld setpoints came\n", robot.statistics().count);
  return 0;
}

}  // namespace

void add_sim_robot(Command app) {
  auto [command, options] = app.add_subcommand<SimRobotOptions>(
      "sim-robot", "Be an arm and its camera, simulated, for another process to steer.", run);
  command.add_option("--rig", options.rig, "The scene before the camera");
  command.add_option("--transport", options.transport, "ros2 or ros1");
  command.add_option("--arm", options.arm, "Namespace of its CRTK topics, where no other arm is");
  command.add_option("--camera", options.camera, "Namespace of image_raw and camera_info");
  command.add_option("--start", options.start, finite_numbers(4),
                     "Measured joints to start from, theta,phi,rho,psi; else random");
  command.add_option("--seed", options.seed, seed_number(), "Seed of start, tissue, noise, jitter");
  command.add_option("--latency-ms", options.latency_ms, between(0.0, 1000.0), "From exposure to publication");
  command.add_option("--fps", options.fps, between(6.0, 120.0), "Frames a second");
  command.add_option("--swing-wrist", options.swing_wrist_rad, between(0.0, 1.0),
                     "Rad: the wrist's first joint moves by itself, there and back within 4 s");
  command.add_option("--duration", options.duration_s, between(0.0, 1e6), "Seconds; 0: until interrupted");
  command.footer(
      "Example, in two terminals (ROS_LOCALHOST_ONLY=1 keeps it on this computer):\n"
      "  lapservo sim-robot --rig configs/paper.yaml\n"
      "  lapservo servo --rig configs/paper.yaml --robot ros2:SIM_PSM1 --camera ros2:/endoscope/image_raw "
      "--enable-motion --joint-limits configs/joint_limits/psm-classic.yaml");
}

}  // namespace lapservo::app
