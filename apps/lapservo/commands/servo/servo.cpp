#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/servo/run_watcher.h"
#include "apps/lapservo/commands/servo/servo_options.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/control/random_start.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/robot/supervisor.h"
#include "lapservo/servo/controller_file.h"
#include "lapservo/servo/goal_check.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/run.h"
#include "lapservo/servo/servo_log.h"
#include "lapservo/servo/tip_goals.h"
#include "lapservo/sim/simulated_wrist.h"
#include "lapservo/sim/simulator.h"
#include "recordings/open_bag.h"

namespace lapservo::app {
using namespace internal;
namespace {

// As things are in the simulation, where `rig` is what the loop goes by.
Rig true_rig_of(const ServoOptions& options, const Rig& rig) {
  Rig truth = rig;
  auto& camera_from_rcm = truth.instruments.front().camera_from_rcm;
  if (camera_from_rcm && !options.registration_error.empty())
    camera_from_rcm->translation += 1e-3 * Eigen::Vector3d(options.registration_error.data());
  return truth;
}

JointVector joints_at_start(const ServoOptions& options, const Trajectory& trajectory, const RunConfig& run,
                            const FeatureModel& true_model, const Eigen::Vector4d& joint_offset) {
  if (!options.start.empty()) return JointVector::from_vector(Eigen::Vector4d(options.start.data()));
  Random random(options.seed);
  TipGoals tips(run.rig, run.controller.scales);
  if (trajectory.tip_at(0)) {
    const JointLimits& limits = run.controller.limits;
    JointState amid_limits;
    amid_limits.q = JointVector::from_vector((limits.lower + limits.upper) / 2);
    if (const auto& tool = run.rig.instruments.front().tool) amid_limits.wrist_rad = simulated_wrist_rad(*tool, 0);
    tips.follow(amid_limits);
    // The start is drawn later, on the goal's side of the marker's seam.
    if (const auto q = tips.configuration(*trajectory.tip_at(0))) amid_limits.q = *q;
    refuse_goal(trajectory, options.duration_s(), run.rig, run.rig.instruments.front().camera_from_rcm, run.controller,
                amid_limits, run.trajectory_name);
  }
  return random_start(tips.features_of(trajectory), options.duration_s(), true_model, run.controller, joint_offset,
                      random, run.trajectory_name);
}

class SimulationWatcher : public RunWatcher {
 public:
  SimulationWatcher(const ServoOptions& options, RunFolder& folder, Supervisor& arm, ServoPage* page,
                    FeatureModel true_model, const Simulator& simulator, ChangingGoal& goal, int ticks)
      : RunWatcher(options, folder, &arm, page),
        true_model_(std::move(true_model)),
        simulator_(simulator),
        goal_(goal),
        progress_(ticks) {}
  void end_progress() { progress_.clear(); }

 private:
  bool follow(const ControlTick& tick, double time_s) override {
    follow_goal(goal_, tick, time_s);
    progress_.show(++done_, fmt::format(" ({})", to_string(tick.decision.control.action)));
    return true;
  }
  std::optional<InstrumentTruth> truth() const override { return truth_at(true_model_, simulator_.true_q()); }

  FeatureModel true_model_;
  const Simulator& simulator_;
  ChangingGoal& goal_;
  Progress progress_;
  int done_ = 0;
};

int simulate(const ServoOptions& options) {
  RunConfig config = run_config_of(options);
  const Rig believed_rig = config.rig, true_rig = true_rig_of(options, believed_rig);
  const FeatureModel true_model = feature_model(true_rig);
  if (config.controller.mode == ControlMode::uncalibrated) forget_registration(config, options);
  const Trajectory trajectory = trajectory_of(options);
  SimulatorConfig simulated;
  simulated.seed = options.seed;
  simulated.endoscope.latency_s = options.latency_ms / 1000;
  simulated.endoscope.frame_rate_hz = options.periods_per_s();
  // The zeros of joints are the rig's: the simulated arm reaches all that the loop's limits allow.
  simulated.arm.lower = simulated.arm.lower.cwiseMin(config.controller.limits.lower);
  simulated.arm.upper = simulated.arm.upper.cwiseMax(config.controller.limits.upper);
  const JointVector start = joints_at_start(options, trajectory, config, true_model, simulated.arm.joint_offset);
  Simulator simulator(true_rig, simulated, start);
  if (!options.hide.empty()) simulator.cover_marker({options.hide[0], options.hide[1]});
  std::optional<ServoPage> page;
  if (options.web.port) page.emplace(options, config.rig, "servo, simulated", true);
  Supervisor arm(simulator, simulator);
  if (options.page_says_operator_present()) arm.watch_operator([&] { return page->operator_present(); });
  RunFolder folder(options, options.duration_s(), believed_rig, config.controller, &true_rig);
  watch_for_interrupts();

  ChangingGoal goal(trajectory, config);
  SimulationWatcher watcher(options, folder, arm, page ? &*page : nullptr, true_model, simulator, goal,
                            static_cast<int>(std::lround(options.duration_s() / config.controller.period_s)));
  lapservo::run(arm, simulator, simulator, config, goal.trajectory(), options.duration_s(), watcher);
  watcher.end_progress();
  std::printf("method %s, seen by %s\n%s\n", std::string(to_string(config.controller.mode)).c_str(),
              config.tracker.method == Method::centerline ? "the paper's Algorithm 1" : "all visible lines",
              watcher.summary().text().c_str());
  return folder.commit() && watcher.summary().succeeded(options.strict) ? 0 : 1;
}

int replay_log(const ServoOptions& options, const Command& command) {
  for (const std::string& name : command.given())
    if (name != "--replay")
      throw InputError(name, "is given, expected none with a log: rig.yaml and controller.yaml beside it count");
  const std::filesystem::path log = options.recorded.input, folder = log.parent_path();
  const auto ticks = read_servo_log(log);  // first: another file has no rig.yaml beside it
  const std::string rig_file = (folder / "rig.yaml").string();
  Rig rig = first_instrument(load_rig(rig_file), rig_file);
  const ControllerConfig controller = load_controller(folder / "controller.yaml", {});
  if (controller.mode == ControlMode::uncalibrated) {
    rig.instruments.front().camera_from_rcm.reset();  // not used
  } else {
    rig = single_instrument(std::move(rig), rig_file);
  }
  const auto difference = replay(ticks, rig, controller);
  if (!difference) {
    std::printf("%zu ticks reproduced bit for bit\n", ticks.size());
    return 0;
  }
  std::fprintf(stderr, "lapservo: %s: tick %zu: %s was %s and is %s now\n", log.c_str(), difference->tick,
               difference->column.c_str(), difference->logged.c_str(), difference->replayed.c_str());
  return 1;
}

void check_operator_present(const ServoOptions& options) {
  const std::string& source = options.operator_present;
  if (source.empty()) return;
  if (!options.recorded.input.empty())
    throw InputError("--operator-present", "is for runs, expected none with --replay");
  if (options.page_says_operator_present() && !options.web.port)
    throw InputError("--operator-present", "is page and there is no page, expected --web with it");
  if (options.robot == "sim" && !options.page_says_operator_present())
    throw InputError("--operator-present", "is " + source + ", which the simulator does not hear, expected page");
}

// Options that would be ignored.
void refuse_idle(const ServoOptions& options, const Command& command) {
  const bool recorded = !options.recorded.input.empty(), simulated = options.robot == "sim";
  if (!recorded)
    command.refuse({"--image-topic", "--joint-topic", "--eye", "--side-by-side"},
                   "is of a recording, expected --replay with it");
  if (recorded || !simulated)
    command.refuse({"--start", "--seed", "--latency-ms", "--registration-error", "--hide"},
                   "is of the simulator, expected --robot sim with it and no --replay");
  if (recorded || simulated)
    command.refuse({"--camera", "--endoscope", "--enable-motion", "--setpoint-readers", "--tf-frames"},
                   "is of an arm, expected --robot ros2:NAMESPACE or ros1:NAMESPACE with it and no --replay");
  if (recorded || (simulated && !options.web.port))
    command.refuse({"--control"},
                   "is of an arm or a page, expected --robot of an arm or --web with it and no --replay");
}

int run(const ServoOptions& options, const Command& command) {
  options.web.check();
  check_operator_present(options);
  const bool recorded = !bag_of(options.recorded.input).empty();
  if (!options.recorded.input.empty() && options.web.port)
    throw InputError("--web", "is for runs, expected none with --replay");
  if (!options.recorded.input.empty() && !recorded) return replay_log(options, command);
  if (options.rig.empty())
    throw InputError("--rig", "is missing, expected a rig's YAML, for example configs/paper.yaml");
  refuse_idle(options, command);
  if (recorded) return decide_on_recording(options);
  if (!options.hide.empty() && !(options.hide[0] < options.hide[1]))
    throw InputError("--hide", "expected from,to in seconds, the later one last");
  if (options.robot == "sim") return simulate(options);
  if (options.robot.find(':') != std::string::npos) return steer_arm(options);
  constexpr auto expected = ", expected sim, ros2:NAMESPACE or ros1:NAMESPACE";
  throw InputError("--robot", (options.robot.empty() ? "is missing" : "is " + options.robot) + expected);
}

void add_arm_options(Command command, ServoOptions& options) {
  command.add_option("--rig", options.rig, "Camera, marker and camera_from_rcm");
  command.add_option(
      "--robot", options.robot,
      "sim: the built-in simulator; ros2:PSM1 or ros1:PSM1: the arm of that CRTK namespace, see docs/dvrk.md");
  command.add_option("--instrument", options.instrument,
                     "The rig's instrument that is steered; else the one of the arm's name, PSM1 for ros2:/dvrk/PSM1");
  command.add_option("--camera", options.camera,
                     "Images of a real arm: ros2:/topic or ros1:/topic, an Image or, where it ends in /compressed, a "
                     "CompressedImage; /dev/videoN; gst:PIPELINE, for example 'gst:decklinkvideosrc ! deinterlace'");
  command.add_option("--endoscope", options.endoscope,
                     "The arm that holds the endoscope and may move slowly meanwhile: ros2:ECM, ros1:ECM. The rig's "
                     "camera_from_rcm is that of the start");
  command.add_option("--control", options.control, one_of({"none", "page", "topics", "both"}),
                     "Who may say stop and start, and set goals: the page of --web, the topics, which anybody in the "
                     "network may publish, both, or nobody but Ctrl-C");
  command.add_option("--operator-present", options.operator_present,
                     "Move the arm only while a button is pressed, and said to be every 0.2 s: of this topic, a "
                     "std_msgs/Bool or the first of a sensor_msgs/Joy; `page`: that of --web's page");
  command.add_flag("--enable-motion", options.enable_motion,
                   "Move a real arm; without it nothing is sent, and what would be is said");
  command.add_option(
      "--joint-limits", options.joint_limits,
      "YAML of the arm's joints, for example configs/joint_limits/psm-classic.yaml; with --enable-motion needed");
  add_setpoint_readers_option(command, options.setpoint_readers);
  add_frame_names_option(command, options.frames);
}

void add_trajectory_options(Command command, ServoOptions& options) {
  command.add_option(
      "--trajectory", options.trajectory,
      "paper: section V-D's sinusoids, omega 0.5 read in rad/s; or a CSV of time_s,s_rad,r_px,l_px,d_px, or of the "
      "tip: time_s,x_m,y_m,z_m with roll_rad or without. Its time stands while the arm is held");
  command.add_option("--set-point", options.set_point, finite_numbers(4),
                     "Instead: s_rad,r_px,l_px,d_px to reach and keep");
  command.add_option(
      "--tip", options.tip, finite_numbers(),
      "Instead: x,y,z or x,y,z,roll of the tip in the camera's frame, metres and rad, to reach and keep, by "
      "the rig's camera_from_rcm and tool. The image closes it across the line of sight; in depth the rig "
      "counts. roll is psi but for whole turns; without it the roll stays");
  command.add_option("--via", options.via, finite_numbers(),
                     "Instead: points s_rad,r_px,l_px,d_px,s_rad,... to pass, a second at rest in each");
  command.add_option("--duration", options.duration, between(0.1, 36000.0), "Seconds, else 20, or all of a recording");
}

void add_control_options(Command command, ServoOptions& options) {
  command.add_option("--method", options.method,
                     "default: measured joints and images fused; paper: its law (eq. 21), gains and Algorithm 1; "
                     "uncalibrated: learns the Jacobian");
  command.add_option("--tracker", options.tracker, one_of({"surface", "centerline"}),
                     "surface: all visible lines; centerline: the paper's Algorithm 1. Without it centerline with "
                     "--method paper, else surface");
  command.add_option("--controller", options.controller,
                     "YAML: gains_per_s, limits, window, delay_s ..., see docs/controller.md");
  command.add_option("--delay-ms", options.delay, "The images' age, or `estimate`");
  command.add_option("--rcm-px", options.rcm_px, finite_numbers(2), "Image of the RCM u,v, for --method uncalibrated");
}

void add_result_options(Command command, ServoOptions& options) {
  command.add_option("--out", options.out,
                     std::string("Folder for log.csv, rig.yaml and controller.yaml") + OutputFolder::help);
  command.add_flag("--force", options.force, OutputFolder::force_help);
  command.add_flag("--strict", options.strict,
                   "End with exit code 1 when the images contradict the rig's camera_from_rcm or lens");
  add_web_options(command, options.web);
}

void add_replay_options(Command command, ServoOptions& options) {
  command.add_option("--replay", options.recorded.input,
                     "A run's log.csv: decide everything again and compare every bit; a bag of ROS 1 or 2, or a "
                     "session of dvrk_data: decide on "
                     "the recorded images and joints as without --enable-motion");
  add_image_topic_option(command, options.recorded.image_topic);
  add_eye_options(command, options.recorded);
  add_joint_topic_option(command, options.recorded.joint_topic);
}

void add_simulator_options(Command command, ServoOptions& options) {
  command.add_option("--start", options.start, finite_numbers(4),
                     "sim: measured joints to start from, theta,phi,rho,psi; else random");
  command.add_option("--seed", options.seed, seed_number(), "sim: of start, tissue, noise, jitter");
  command.add_option("--latency-ms", options.latency_ms, between(0.0, 1000.0), "sim: from exposure to arrival");
  command.add_option("--fps", options.fps, between(6.0, 500.0),
                     "Control periods, and frames in sim, a second; else 60 in sim and 120 with an arm");
  command.add_option("--registration-error", options.registration_error, finite_numbers(3),
                     "sim: x,y,z: the true RCM lies by so many mm, in the camera's frame, beside the rig's");
  command.add_option("--hide", options.hide, finite_numbers(2), "sim: cover the marker from,to seconds");
}

}  // namespace

void add_servo(Command app) {
  auto [command, options] =
      app.add_subcommand<ServoOptions>("servo", "Steer the instrument along a trajectory of image features.", run);
  add_arm_options(command, options);
  add_trajectory_options(command, options);
  add_control_options(command, options);
  add_result_options(command, options);
  add_replay_options(command, options);
  add_simulator_options(command, options);
  command.footer(
      "The paper's gains K = 0.032, 0.008, 0.0008, 0.01 (s, r, l, d) and omega = 0.5 have no unit of time in it. Here "
      "K\n"
      "is read per control period (gains_per_s = K times --fps) and omega per second.\n"
      "Examples:\n"
      "  lapservo servo --rig configs/paper.yaml --robot sim --out run\n"
      "  lapservo servo --rig configs/paper.yaml --robot sim --set-point 0.9,795,365,212 --hide 3,4 --web\n"
      "  lapservo servo --rig rig.yaml --robot sim --tip 0.005,0.01,0.12\n"
      "  lapservo servo --rig configs/paper.yaml --robot ros2:PSM1 --camera /dev/video0 --web\n"
      "  lapservo servo --replay run/log.csv\n"
      "  lapservo servo --replay swing.bag --rig rig.yaml --out decided");
}

}  // namespace lapservo::app
