#pragma once

#include <optional>

#include <Eigen/Core>

#include "lapservo/control/controller_config.h"
#include "lapservo/control/feature_model.h"

namespace lapservo::internal {

/// Result of a search for the q at which a model shows given features.
struct NewtonInverse {
  Eigen::Vector4d q = Eigen::Vector4d::Zero();  ///< the best found
  Eigen::Vector4d residual =
      Eigen::Vector4d::Zero();  ///< target minus features at q; zero to rounding when `converged`
  bool converged = false;
};

/// Damped Newton's method with step halving, from `guess`. nullopt when the model sees nothing at the guess.
std::optional<NewtonInverse> newton_inverse(const FeatureModel& model, const Eigen::Vector4d& target,
                                            const Eigen::Vector4d& guess, const Scales& scales);

}  // namespace lapservo::internal
