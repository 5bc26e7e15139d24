#pragma once

#include "apps/lapservo/commands/servo/servo_options.h"

namespace lapservo::app {

/// `lapservo servo` with a CRTK arm and a camera behind a transport. Returns the exit code: 0 when it converged.
int steer_arm(const ServoOptions& options);

}  // namespace lapservo::app
