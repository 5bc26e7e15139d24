#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "apps/lapservo/input_files.h"
#include "apps/lapservo/interrupt.h"
#include "apps/lapservo/live_view.h"
#include "apps/lapservo/numbers.h"
#include "apps/lapservo/output_folder.h"
#include "apps/lapservo/progress.h"
#include "apps/lapservo/subcommands.h"
#include "lapservo/control/paper_trajectory.h"
#include "lapservo/control/random_start.h"
#include "lapservo/control/tracking_law.h"
#include "lapservo/control/trajectory_check.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/random.h"
#include "lapservo/experiments/setup.h"
#include "lapservo/io/overlay.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/rig/single_instrument.h"
#include "lapservo/servo/controller_file.h"
#include "lapservo/servo/convergence.h"
#include "lapservo/servo/image_features.h"
#include "lapservo/servo/image_window.h"
#include "lapservo/servo/replay.h"
#include "lapservo/servo/run.h"
#include "lapservo/servo/servo_log.h"
#include "lapservo/sim/simulator.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

constexpr double window_margin_px = 20, via_dwell_s = 1;
const Eigen::Vector4d via_rate(0.05, 60, 40, 40);  // s_rad, r, l, d px a second

struct Options {
  std::string rig, robot, trajectory = "paper", method = "default", tracker, controller, delay = "estimate", out,
                          replay;
  std::vector<double> set_point, via, start, rcm_px, hide;
  double duration_s = 20, latency_ms = 80, fps = 60;
  std::uint64_t seed = 1;
  bool view = false, force = false;
};

Eigen::Vector4d four(const std::vector<double>& values) {
  return Eigen::Vector4d(values.data());
}

ControllerConfig controller_of(const Options& options, const Rig& rig) {
  ControllerConfig config;
  const auto mode = control_mode_from_string(options.method);
  if (!mode) throw InputError("--method", "is " + options.method + ", expected default, paper or uncalibrated");
  if (*mode == ControlMode::paper) config = paper_controller(1 / options.fps);
  config.mode = *mode;
  config.period_s = 1 / options.fps;
  config.window = image_window(rig.camera, window_margin_px);
  if (options.delay != "estimate") {
    const auto delay_ms = parse_finite(options.delay);
    if (!delay_ms) throw InputError("--delay-ms", "is " + options.delay + ", expected milliseconds or `estimate`");
    config.observer.delay_s = *delay_ms / 1000;
  }
  if (!options.controller.empty()) config = load_controller(options.controller, config);
  return checked(config);
}

// The paper's law comes with the paper's eyes.
Method tracker_of(const Options& options, ControlMode mode) {
  const bool own = options.tracker.empty() && mode == ControlMode::paper;
  return own || options.tracker == "centerline" ? Method::centerline : Method::surface;
}

std::vector<Eigen::Vector4d> points_of(const std::vector<double>& numbers) {
  if (numbers.size() % 4 != 0)
    throw InputError("--via",
                     fmt::format("holds {} numbers, expected four (s_rad,r_px,l_px,d_px) a point", numbers.size()));
  std::vector<Eigen::Vector4d> points;
  for (std::size_t i = 0; i < numbers.size(); i += 4) points.emplace_back(numbers.data() + i);
  return points;
}

// What the trajectory is called in complaints.
std::string trajectory_name(const Options& options) {
  if (!options.set_point.empty()) return "--set-point";
  return options.via.empty() ? options.trajectory : "--via";
}

Trajectory trajectory_of(const Options& options) {
  if (!options.set_point.empty()) return set_point(four(options.set_point));
  if (!options.via.empty()) return via_points(points_of(options.via), via_rate, via_dwell_s);
  if (options.trajectory == "paper") return sinusoids(paper_sinusoids());
  return trajectory_from_csv(options.trajectory);
}

// The uncalibrated mode gets to know no more of the RCM than its image.
void forget_registration(RunConfig& run, const Options& options) {
  Instrument& instrument = run.rig.instruments.front();
  if (!options.rcm_px.empty()) {
    run.rcm_px = Eigen::Vector2d(options.rcm_px[0], options.rcm_px[1]);
  } else if (instrument.camera_from_rcm) {
    run.rcm_px = projected_rcm_px(run.rig.camera, *instrument.camera_from_rcm);
  }
  if (!run.rcm_px)
    throw InputError("--rcm-px", "is missing and " + options.rig +
                                     " has no camera_from_rcm, expected the RCM's image: see lapservo estimate-rcm");
  instrument.camera_from_rcm.reset();
}

// Before it is made to forget anything.
RunConfig run_config_of(const Options& options) {
  RunConfig run;
  run.rig = single_instrument(load_rig(options.rig), options.rig);
  run.controller = controller_of(options, run.rig);
  run.tracker.method = tracker_of(options, run.controller.mode);
  return run;
}

JointVector joints_at_start(const Options& options, const Trajectory& trajectory, const RunConfig& run,
                            const FeatureModel& true_model, const Eigen::Vector4d& joint_offset) {
  const std::string source = trajectory_name(options);
  if (options.start.empty()) {
    Random random(options.seed);
    return random_start(trajectory, options.duration_s, true_model, run.controller, joint_offset, random, source);
  }
  const JointVector start = JointVector::from_vector(four(options.start));
  refuse_infeasible(trajectory, options.duration_s, true_model, run.controller, start, source);
  return start;
}

class RunFolder {
 public:
  // With the whole rig, whatever the method forgets of it: the frames can be tracked with it too.
  RunFolder(const Options& options, const Rig& rig, const ControllerConfig& controller)
      : folder_(options.out, rig, inputs_of(options, rig), options.force, needed_bytes(options)),
        log_(folder_ / "log.csv") {
    write_file(folder_ / "controller.yaml", controller_yaml(controller));
  }
  ServoLog& log() { return log_; }
  void commit() {
    log_.commit();
    folder_.commit();
  }

 private:
  static std::uintmax_t needed_bytes(const Options& options) {
    constexpr std::uintmax_t bytes_a_tick = 2000;
    return bytes_a_tick * static_cast<std::uintmax_t>(options.duration_s * options.fps) + (1 << 20);
  }
  static InputFiles inputs_of(const Options& options, const Rig& rig) {
    InputFiles inputs;
    inputs.add_rig(options.rig, rig);
    inputs.add(options.controller);
    inputs.add(options.trajectory);
    return inputs;
  }

  OutputFolder folder_;
  ServoLog log_;
};

// What the run came to, for the last lines.
class Summary {
 public:
  void add(const ControlTick& tick, const InstrumentTruth& truth) {
    const ControlStep& control = tick.decision.control;
    ++ticks_;
    if (control.action == ControlAction::hold) ++held_[std::string(to_string(control.reason))];
    const Eigen::Vector4d error =
        truth.features ? feature_error(*truth.features, tick.input.desired.features) : control.error;
    convergence_.add(tick.input.time_s, error);
  }
  bool converged() const { return convergence_.reached_s().has_value(); }
  std::string text() const {
    std::string text = "not within 1 px and 5 mrad for a second";
    if (const auto reached_s = convergence_.reached_s()) {
      const Eigen::Vector4d rms = convergence_.rms_since();
      text = fmt::format(
          "within 1 px and 5 mrad from {:.2f} s on; rms since: s {:.2f} mrad, r {:.2f}, l {:.2f}, d {:.2f} px",
          *reached_s, 1000 * rms[0], rms[1], rms[2], rms[3]);
    }
    for (const auto& [reason, count] : held_)
      text += fmt::format("\nheld for {} of {} ticks: {}", count, ticks_, reason);
    return text;
  }

 private:
  long ticks_ = 0;
  std::map<std::string, long> held_;
  Convergence convergence_;
};

bool show(LiveView& view, const ControlTick& tick, const Rig& rig) {
  if (!tick.seen) return true;
  const ControlStep& control = tick.decision.control;
  cv::Mat picture = draw_overlay(tick.seen->image.bgr, rig, tick.seen->observations);
  const std::string label = fmt::format("{:.2f} s  {} {}", tick.input.time_s, to_string(control.action),
                                        control.reason == HoldReason::none ? "" : to_string(control.reason));
  cv::putText(picture, label, {16, 32}, cv::FONT_HERSHEY_SIMPLEX, 0.8, {255, 255, 255}, 2, cv::LINE_AA);
  return view.show(picture);
}

// What the user gets of a run: the log, the picture, the progress, the last lines.
class Watcher : public RunObserver {
 public:
  Watcher(const Rig& rig, const FeatureModel& true_model, const Simulator& simulator, RunFolder* folder, LiveView* view,
          int ticks)
      : rig_(rig),
        true_model_(true_model),
        simulator_(simulator),
        folder_(folder),
        view_(view),
        progress_(std::make_unique<Progress>(ticks)) {}

  bool on_tick(const ControlTick& tick) override {
    const InstrumentTruth truth = truth_at(true_model_, simulator_.true_q());
    summary_.add(tick, truth);
    if (folder_) folder_->log().add(tick.input, tick.decision, truth);
    progress_->show(++done_, fmt::format(" ({})", to_string(tick.decision.control.action)));
    return !interrupted() && (!view_ || show(*view_, tick, rig_));
  }
  const Summary& finish() {
    progress_.reset();
    return summary_;
  }

 private:
  Rig rig_;
  FeatureModel true_model_;
  const Simulator& simulator_;
  RunFolder* folder_;
  LiveView* view_;
  std::unique_ptr<Progress> progress_;
  Summary summary_;
  int done_ = 0;
};

int simulate(const Options& options) {
  std::optional<LiveView> view;
  if (options.view) view.emplace("servo", "use --out to write a log instead");
  RunConfig config = run_config_of(options);
  const Rig true_rig = config.rig;
  const FeatureModel true_model = feature_model(true_rig);
  if (config.controller.mode == ControlMode::uncalibrated) forget_registration(config, options);
  const Trajectory trajectory = trajectory_of(options);
  SimulatorConfig simulated;
  simulated.seed = options.seed;
  simulated.endoscope.latency_s = options.latency_ms / 1000;
  simulated.endoscope.frame_rate_hz = options.fps;
  const JointVector start = joints_at_start(options, trajectory, config, true_model, simulated.arm.joint_offset);
  Simulator simulator(true_rig, simulated, start);
  if (!options.hide.empty()) simulator.cover_marker({options.hide[0], options.hide[1]});
  std::optional<RunFolder> folder;
  if (!options.out.empty()) folder.emplace(options, true_rig, config.controller);
  watch_for_interrupts();

  Watcher watcher(config.rig, true_model, simulator, folder ? &*folder : nullptr, view ? &*view : nullptr,
                  static_cast<int>(std::lround(options.duration_s / config.controller.period_s)));
  lapservo::run(simulator, simulator, simulator, config, trajectory, options.duration_s, watcher);
  const Summary& summary = watcher.finish();
  std::printf("method %s, seen by %s\n%s\n", std::string(to_string(config.controller.mode)).c_str(),
              config.tracker.method == Method::centerline ? "the paper's Algorithm 1" : "all visible lines",
              summary.text().c_str());
  if (folder) {
    folder->commit();
    std::printf("log, rig and controller: %s\n", options.out.c_str());
  }
  return summary.converged() ? 0 : 1;
}

int replay_log(const Options& options) {
  const fs::path log = options.replay, folder = log.parent_path();
  const Rig rig = single_instrument(load_rig(folder / "rig.yaml"), (folder / "rig.yaml").string());
  const ControllerConfig controller = load_controller(folder / "controller.yaml", {});
  const auto ticks = read_servo_log(log);
  const auto difference = replay(ticks, rig, controller);
  if (!difference) {
    std::printf("%zu ticks reproduced bit for bit\n", ticks.size());
    return 0;
  }
  std::fprintf(stderr, "lapservo: %s: tick %zu: %s was %s and is %s now\n", log.c_str(), difference->tick,
               difference->column.c_str(), difference->logged.c_str(), difference->replayed.c_str());
  return 1;
}

int run(const Options& options) {
  if (!options.replay.empty()) return replay_log(options);
  if (options.rig.empty())
    throw InputError("--rig", "is missing, expected a rig's YAML, for example configs/paper.yaml");
  if (options.robot != "sim")
    throw InputError("--robot",
                     options.robot.empty() ? "is missing, expected sim" : "is " + options.robot + ", expected sim");
  return simulate(options);
}

}  // namespace

void add_servo(CLI::App& app, Run& run_later) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("servo", "Steer the instrument along a trajectory of image features.");
  command->add_option("--rig", options->rig, "Camera, marker and camera_from_rcm");
  command->add_option("--robot", options->robot, "sim: the built-in simulator");
  command
      ->add_option("--trajectory", options->trajectory,
                   "paper: section V-D's sinusoids, omega 0.5 read in rad/s; or a CSV of time_s,s_rad,r_px,l_px,d_px")
      ->capture_default_str();
  command->add_option("--set-point", options->set_point, "Instead: s_rad,r_px,l_px,d_px to reach and keep")
      ->check(finite_number())
      ->delimiter(',')
      ->expected(4);
  command
      ->add_option("--via", options->via,
                   "Instead: points s_rad,r_px,l_px,d_px,s_rad,... to pass, a second at rest in each")
      ->check(finite_number())
      ->delimiter(',');
  command->add_option("--duration", options->duration_s, "Seconds")
      ->capture_default_str()
      ->check(number_between(0.1, 36000.0));
  command
      ->add_option("--method", options->method,
                   "default: measured joints and images fused; paper: its law (eq. 21), gains and Algorithm 1; "
                   "uncalibrated: learns "
                   "the Jacobian")
      ->capture_default_str();
  command
      ->add_option("--tracker", options->tracker,
                   "surface: all visible lines; centerline: the paper's Algorithm 1. Without it centerline with "
                   "--method paper, else surface")
      ->check(CLI::IsMember({"surface", "centerline"}));
  command->add_option("--controller", options->controller, "YAML: gains_per_s, limits, window, delay_s ...");
  command->add_option("--delay-ms", options->delay, "The images' age, or `estimate`")->capture_default_str();
  command->add_option("--rcm-px", options->rcm_px, "Image of the RCM u,v, for --method uncalibrated")
      ->check(finite_number())
      ->delimiter(',')
      ->expected(2);
  command->add_option("--out", options->out,
                      std::string("Folder for log.csv, rig.yaml and controller.yaml") + OutputFolder::help);
  command->add_flag("--force", options->force, OutputFolder::force_help);
  command->add_flag("--view", options->view, "Show it live");
  command->add_option("--replay", options->replay, "A run's log.csv: decide everything again and compare every bit");
  command->add_option("--start", options->start, "sim: measured joints to start from, theta,phi,rho,psi; else random")
      ->check(finite_number())
      ->delimiter(',')
      ->expected(4);
  command->add_option("--seed", options->seed, "sim: of start, tissue, noise, jitter")
      ->capture_default_str()
      ->check(seed_number());
  command->add_option("--latency-ms", options->latency_ms, "sim: from exposure to arrival")
      ->capture_default_str()
      ->check(number_between(0.0, 1000.0));
  command->add_option("--fps", options->fps, "Control periods, and frames in sim, a second")
      ->capture_default_str()
      ->check(number_between(6.0, 500.0));
  command->add_option("--hide", options->hide, "sim: cover the marker from,to seconds")
      ->check(finite_number())
      ->delimiter(',')
      ->expected(2);
  command->footer(
      "The paper's gains K = 0.032, 0.008, 0.0008, 0.01 (s, r, l, d) and omega = 0.5 have no unit of time in it. Here "
      "K\n"
      "is read per control period (gains_per_s = K times --fps) and omega per second.\n"
      "Examples:\n"
      "  lapservo servo --rig configs/paper.yaml --robot sim --out run\n"
      "  lapservo servo --rig configs/paper.yaml --robot sim --set-point 0.9,795,365,212 --hide 3,5 --view\n"
      "  lapservo servo --replay run/log.csv");
  command->callback([options, &run_later] { run_later = [options] { return run(*options); }; });
}

}  // namespace lapservo::app
