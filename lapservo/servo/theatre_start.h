#pragma once

#include <string>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/core/random.h"
#include "lapservo/kinematics/rcm_coordinates.h"
#include "lapservo/rig/rig.h"
#include "lapservo/sim/arm.h"

namespace lapservo {

/// Throws InputError, naming `source`, the time and the limit, when the trajectory can't be followed from these
/// readings as far as the rig's model knows (it needs camera_from_rcm; without it nothing is checked).
void refuse_infeasible(const Trajectory& trajectory, double duration_s, const Rig& rig,
                       const ControllerConfig& controller, const RcmCoordinates& readings, const std::string& source);

/// Readings of a simulated arm at a random place from which the trajectory can be followed: both ends of the marker lie
/// in the window, the readings within the limits, and the marker's seam is not to be crossed on the way. For the paper's
/// law, which leads each feature home at a pace of its own and asks for nothing else, the start lies where all features
/// on that way can be shown. Throws as refuse_infeasible() does when there seems to be none.
RcmCoordinates random_start(const Trajectory& trajectory, double duration_s, const Rig& rig,
                            const ControllerConfig& controller, const ArmConfig& arm, Random& random,
                            const std::string& source);

}  // namespace lapservo
