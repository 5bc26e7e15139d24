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

}  // namespace lapservo::python
