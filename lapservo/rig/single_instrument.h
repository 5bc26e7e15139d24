#pragma once

#include <string>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The rig with its first instrument only, which the simulator and the experiments use. Throws InputError naming
/// `source` when that has no camera_from_rcm.
Rig single_instrument(Rig rig, const std::string& source);

}  // namespace lapservo::internal
