#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"

namespace lapservo::app {

struct CalibrateCameraOptions : FrameOptions {
  std::vector<std::string> inputs;
  std::string rig, out, camera_info;
  BoardOptions board;
  std::size_t views = 30;

  /// Where the rig goes; empty without one.
  const std::string& rig_out() const { return rig.empty() || !out.empty() ? out : rig; }
  std::string input() const { return inputs.size() == 1 ? inputs.front() : inputs.front() + " and others"; }
};

struct CalibrateColourOptions : CalibrateOptions {
  bool replace_response = false;
};

// The jobs of the subcommands of these names. Each returns the exit code, 0 or 1, and throws InputError for bad input.
int calibrate_camera(const CalibrateCameraOptions& options);
int calibrate_colour(const CalibrateColourOptions& options);
int calibrate_marker(const CalibrateOptions& options);
int calibrate_registration(const CalibrateOptions& options);
/// `out` stays empty: the page is the report.
int check(const CalibrateOptions& options);

/// Options of `lapservo record`.
struct RecordOptions {
  std::string camera, robot, rig, out, move, joint_limits, instrument;
  double duration_s = 20, scale = 1, fps = 30;
  int setpoint_readers = 1;
  bool until_enter = false, enable_motion = false;
};

/// Records until the time is up, the motion done, Ctrl-C or, with that option, a line on standard input. Exit code 1
/// when no image came or the motion did not end well; the bag keeps what was recorded.
int record(const RecordOptions& options);

}  // namespace lapservo::app
