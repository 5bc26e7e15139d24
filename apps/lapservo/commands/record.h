#pragma once

#include <string>

namespace lapservo::app {

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
