#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/feature_model.h"
#include "lapservo/control/trajectory.h"
#include "lapservo/core/joint_vector.h"

namespace lapservo {

/// The first thing that keeps a trajectory from being followed.
struct Infeasible {
  double time_s = 0;
  std::string what;  ///< the limit's name with value and bound, for example "limits.upper rho_m 0.2: needs 0.213"
  std::string text() const;  ///< "can't be followed at 1.20 s: ..."
};

/// Walks along the trajectory from 0 to `duration_s` in steps of `step_s`, finds the configuration at each step by the
/// inverse of the model from the previous one, starting near `q_start`, and checks: the features are reachable, the
/// Jacobian is regular, joints and their rates are within limits, the marker's ends are within the window. nullopt when
/// all hold. The model is the rig's: offsets between measured joints and truth are unknown beforehand. By an empty
/// model only features that no marker shows are found: numbers that are not finite, r < 0, d outside (0, l).
std::optional<Infeasible> find_infeasible(const Trajectory& trajectory, double duration_s, const FeatureModel& model,
                                          const ControllerConfig& config, const Eigen::Vector4d& q_start,
                                          double step_s = 0.02);

/// Throws InputError, naming `source`, the time and the limit, when the trajectory can't be followed from these joints
/// as far as the model knows: see find_infeasible().
void refuse_infeasible(const Trajectory& trajectory, double duration_s, const FeatureModel& model,
                       const ControllerConfig& config, const JointVector& q_start, const std::string& source);

/// The limit that a configuration breaks, which shows these features and lets them move at this rate; nullopt for none.
std::optional<std::string> broken_limit(const ControllerConfig& config, const FeatureState& state,
                                        const Eigen::Vector4d& q, const Eigen::Vector4d& feature_rate);

}  // namespace lapservo
