#pragma once

#include <string>

namespace lapservo::app {

/// What `lapservo record` was asked for.
struct RecordOptions {
  std::string camera, robot, rig, out, move, joint_limits, instrument;
  double duration_s = 20, scale = 1, fps = 30;
  bool until_enter = false, enable_motion = false;
};

/// Records until the time is up, the motion done, Ctrl-C or, where that is asked for, a line on standard input. Exit
/// code 1 when no image came or the motion did not end well; the bag stays as far as it came.
int record(const RecordOptions& options);

}  // namespace lapservo::app
