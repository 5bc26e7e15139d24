#pragma once

#include <string>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/feature_model.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/core/joint_vector.h"
#include "lapservo/core/random.h"

namespace lapservo::internal {

/// Measured joints at a random place from which the trajectory can be followed, for a simulated arm whose instrument
/// is at the measured joints plus `joint_offset`: both ends of the marker lie in the window, the joints within the
/// limits, and the marker's seam is not to be crossed on the way. Throws as refuse_infeasible() does when there seems
/// to be none: what keeps most places drawn from it.
JointVector random_start(const Trajectory& trajectory, double duration_s, const FeatureModel& model,
                         const ControllerConfig& config, const Eigen::Vector4d& joint_offset, Random& random,
                         const std::string& source);

}  // namespace lapservo::internal
