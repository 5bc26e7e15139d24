#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apps/lapservo/cli/web_view.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/servo/run.h"

namespace lapservo::app {

/// Options of `lapservo servo`.
struct ServoOptions {
  std::string rig, robot, instrument, camera, joint_limits, trajectory = "paper", method = "default", tracker,
                                                            controller, delay = "estimate", out, control = "both",
                                                            operator_present, endoscope, frames = default_frames;
  std::vector<double> set_point, tip, via, start, rcm_px, hide;
  std::vector<double> registration_error;  // 3 x mm
  double latency_ms = 80;
  std::optional<double> duration;  // s
  std::optional<double> fps;       // control periods a second, and frames of the simulation
  std::uint64_t seed = 1;
  int setpoint_readers = 1;
  bool force = false, enable_motion = false, strict = false;
  WebOptions web;
  RecordingOptions recorded;  // its input: of --replay

  /// Else a topic does, or nobody has to.
  bool page_says_operator_present() const { return operator_present == "page"; }
  /// Whether "page" or "topics" may say stop and start, and set goals.
  bool may_command(std::string_view who) const { return control == who || control == "both"; }
  /// The option, else 60 in the simulation and 120 with an arm, where an image waits for the next period.
  double periods_per_s() const { return fps.value_or(robot == "sim" ? 60 : 120); }
  double duration_s() const { return duration.value_or(20); }
};

/// Before it is made to forget anything. The rig's first instrument is steered, the others are tracked with it.
RunConfig run_config_of(const ServoOptions& options);
/// The uncalibrated mode gets to know no more of the RCM than its image.
void forget_registration(RunConfig& run, const ServoOptions& options);
/// The instrument that is steered: the rig's first. Throws InputError when it has no `joints`.
const Instrument& arm_of(const ServoOptions& options, const Rig& rig);

Trajectory trajectory_of(const ServoOptions& options);

}  // namespace lapservo::app
