#pragma once

#include <string>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The rig with its first instrument only. Throws InputError naming `source` when there is none.
Rig first_instrument(Rig rig, const std::string& source);

/// The same for the simulator, the experiments and the calibrated loop, which need camera_from_rcm: throws InputError
/// where it is missing.
Rig single_instrument(Rig rig, const std::string& source);

}  // namespace lapservo::internal
