#pragma once

#include <cstddef>
#include <optional>
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

}  // namespace lapservo::app
