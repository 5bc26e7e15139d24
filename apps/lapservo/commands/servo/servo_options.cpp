#include "apps/lapservo/commands/servo/servo_options.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

#include <Eigen/Core>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/control/paper_trajectory.h"
#include "lapservo/core/csv.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"
#include "lapservo/crtk/arm_limits.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/joint_map.h"
#include "lapservo/experiments/setup.h"
#include "lapservo/kinematics/centre_line.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/servo/controller_file.h"
#include "lapservo/servo/image_window.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr double window_margin_px = 20, via_dwell_s = 1;
const Eigen::Vector4d via_rate(0.05, 60, 40, 40);  // s_rad, r, l, d px a second

ControllerConfig controller_of(const ServoOptions& options, const Rig& rig) {
  ControllerConfig config;
  const auto mode = control_mode_from_string(options.method);
  if (!mode) throw InputError("--method", "is " + options.method + ", expected default, paper or uncalibrated");
  if (*mode == ControlMode::paper) config = paper_controller(1 / options.periods_per_s());
  config.mode = *mode;
  config.period_s = 1 / options.periods_per_s();
  config.window = image_window(rig.camera, window_margin_px);
  if (options.delay != "estimate") {
    const auto delay_ms = parse_finite(options.delay);
    if (!delay_ms) throw InputError("--delay-ms", "is " + options.delay + ", expected milliseconds or `estimate`");
    if (*delay_ms > 0 && *delay_ms < 1)
      throw InputError("--delay-ms", "is " + options.delay + ", expected milliseconds: it looks like seconds");
    config.observer.delay_s = *delay_ms / 1000;
  }
  std::optional<JointLimits> of_arm;
  if (!options.joint_limits.empty())
    of_arm = limits_of_q(*arm_of(options, rig).joints, load_arm_limits(options.joint_limits));
  const auto file =
      options.controller.empty() ? std::nullopt : std::optional<std::filesystem::path>(options.controller);
  return controller_for_arm(std::move(config), file, of_arm);
}

std::string names_of(const Rig& rig) {
  return fmt::format("{}", fmt::join(values_of(rig.instruments, &Instrument::name), ", "));
}

// PSM1 of ros2:/dvrk/PSM1; empty without an arm.
std::string arm_name(const std::string& robot) {
  const std::size_t colon = robot.find(':');
  return colon == std::string::npos ? std::string() : instrument_of(robot.substr(colon + 1));
}

// First the instrument of --instrument, else that of the arm's name, else the rig's first: another arm's rig would move
// the wrong joints. The others are tracked beside it, since one that crosses hides it or looks like it.
Rig steered_rig(const ServoOptions& options) {
  Rig rig = load_rig(options.rig);
  const std::string arm = arm_name(options.robot);
  const std::string wanted = options.instrument.empty() ? arm : options.instrument;
  const auto found = std::find_if(rig.instruments.begin(), rig.instruments.end(),
                                  [&](const Instrument& instrument) { return instrument.name == wanted; });
  if (found != rig.instruments.end()) {
    std::iter_swap(rig.instruments.begin(), found);
  } else if (!options.instrument.empty()) {
    throw InputError("--instrument", "is " + wanted + ", expected one of the rig's: " + names_of(rig));
  } else if (!arm.empty() && !rig.instruments.empty()) {
    throw InputError("--robot", fmt::format("is {}, and the rig has {}: expected the rig of that arm, or --instrument "
                                            "{} where it is that arm's under another name",
                                            arm, names_of(rig), rig.instruments.front().name));
  }
  return rig;
}

std::vector<Eigen::Vector4d> points_of(const std::vector<double>& numbers) {
  if (numbers.size() % 4 != 0)
    throw InputError("--via",
                     fmt::format("holds {} numbers, expected four (s_rad,r_px,l_px,d_px) a point", numbers.size()));
  std::vector<Eigen::Vector4d> points;
  for (std::size_t i = 0; i < numbers.size(); i += 4) points.emplace_back(numbers.data() + i);
  return points;
}

TipGoal tip_of(const std::vector<double>& numbers) {
  if (numbers.size() != 3 && numbers.size() != 4)
    throw InputError("--tip", fmt::format("holds {} numbers, expected x,y,z or x,y,z,roll", numbers.size()));
  return {Eigen::Vector3d(numbers.data()), numbers.size() == 4 ? std::optional(numbers[3]) : std::nullopt};
}

// The one option that has the goal, "--trajectory paper" where none was given.
std::string goal_option(const ServoOptions& options) {
  std::vector<std::string> given;
  if (!options.set_point.empty()) given.emplace_back("--set-point");
  if (!options.tip.empty()) given.emplace_back("--tip");
  if (!options.via.empty()) given.emplace_back("--via");
  if (options.trajectory != "paper" || given.empty()) given.emplace_back("--trajectory");
  if (given.size() > 1) throw InputError(given[1], "is a second goal beside " + given[0] + ", expected one");
  return given[0];
}

}  // namespace

const Instrument& arm_of(const ServoOptions& options, const Rig& rig) {
  const Instrument& instrument = rig.instruments.front();
  if (!instrument.joints)
    throw InputError(options.rig, "instruments[0].joints is missing, expected the arm's joints: names, sign, offset");
  return instrument;
}

Trajectory trajectory_of(const ServoOptions& options) {
  const std::string goal = goal_option(options);
  if (goal == "--set-point") return set_point(Eigen::Vector4d(options.set_point.data()));
  if (goal == "--tip") return tip_set_point(tip_of(options.tip), "--tip");
  if (goal == "--via") return via_points(points_of(options.via), via_rate, via_dwell_s);
  if (options.trajectory == "paper") return sinusoids(paper_sinusoids());
  return trajectory_from_csv(options.trajectory);
}

void forget_registration(RunConfig& run, const ServoOptions& options) {
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

RunConfig run_config_of(const ServoOptions& options) {
  RunConfig run;
  run.rig = steered_rig(options);
  run.controller = controller_of(options, run.rig);
  if (run.controller.mode != ControlMode::uncalibrated && !options.rcm_px.empty())
    throw InputError("--rcm-px", "is of another method, expected --method uncalibrated with it");
  if (options.robot == "sim") run.rig = single_instrument(std::move(run.rig), options.rig);  // it has no others
  if (run.controller.mode != ControlMode::uncalibrated) require_registration(run.rig, options.rig);
  const std::string goal = goal_option(options);
  run.trajectory_name = goal == "--trajectory" ? options.trajectory : goal;
  say_axis_tip(run.rig.instruments.front());
  // The paper's law comes with the paper's eyes.
  const bool own = options.tracker.empty() && run.controller.mode == ControlMode::paper;
  run.tracker.method = own || options.tracker == "centerline" ? Method::centerline : Method::surface;
  return run;
}

}  // namespace lapservo::app
