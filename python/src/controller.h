#pragma once

#include <string>

#include "lapservo/control/controller_config.h"

namespace lapservo::python {

/// Remembers whether its limits are the arm's own, which an arm that is not simulated needs.
struct Controller : ControllerConfig {
  bool has_joint_limits = false;
};

/// A robot that moves one instrument only has it as a base.
struct ArmOf {
  std::string instrument;
};

/// Whether this thread's call is the loop's, passed on by a robot in Python; else it is an onlooker's.
inline thread_local bool loop_asks = false;

}  // namespace lapservo::python
