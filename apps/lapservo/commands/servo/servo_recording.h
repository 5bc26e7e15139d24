#pragma once

#include "apps/lapservo/commands/servo/servo_options.h"

namespace lapservo::app {

/// `servo --replay BAG`: the loop over what a bag recorded of an arm and its camera, as it would have gone by it
/// without --enable-motion; what it decides moves nothing. Returns the exit code: 1 when it would have held throughout.
int decide_on_recording(const ServoOptions& options);

}  // namespace lapservo::app
