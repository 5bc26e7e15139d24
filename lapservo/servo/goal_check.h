#pragma once

#include <optional>
#include <string>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/rig/rig.h"
#include "lapservo/robot/robot.h"

namespace lapservo::internal {

/// Throws InputError, naming `source`, the time and the limit, when a goal can't be followed from these joints, as far
/// as camera_from_rcm and the rig know: of features see refuse_infeasible(); of the tip a place that is not before the
/// camera, that no configuration within the limits reaches, or where the marker leaves the image. A roll counts by the
/// turn to which the features lead from these joints, where the marker's seam never faces the camera. The message has
/// the nearest place that can be reached, in digits that are not refused.
void refuse_goal(const Trajectory& goal, double duration_s, const Rig& rig,
                 const std::optional<Rigid3>& camera_from_rcm, const ControllerConfig& config, const JointState& joints,
                 const std::string& source);

}  // namespace lapservo::internal
