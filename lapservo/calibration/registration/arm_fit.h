#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/fit/at_iteration.h"
#include "lapservo/calibration/marker/frame_fit.h"
#include "lapservo/calibration/registration/arm_model.h"
#include "lapservo/calibration/registration/arm_start.h"

namespace lapservo::internal {

/// An arm's model, fitted to poses and readings.
struct ArmFit {
  ArmModel model;
  FrameFit fit;
  /// Covariance of fit.x, with the square of its displacement by faults of the readings that show.
  Eigen::MatrixXd covariance;
  Eigen::VectorXd noise;            ///< how many times the poses' own sigmas the residuals are, by channel
  std::vector<std::string> faults;  ///< of the readings, that show, in words; the clearest first
};

/// `free`: faults that are fitted beside the registration. Nullopt where the motion leaves a number open, and where it
/// takes a backlash of half of a joint's travel.
std::optional<ArmFit> fit_arm(const Instrument& instrument, const ArmStart& start, const JointRecording& recording,
                              const ArmFaults& free, const AtIteration& at_iteration = {});

/// Why readings and poses disagree: the one fault of the readings that explains it best, in words; empty when none
/// does. `fit`: what there is without; null where there is none.
std::string explaining_fault(const Instrument& instrument, const std::vector<TimedPose>& poses,
                             const JointRecording& recording, const std::string& source, const ArmFit* fit,
                             const AtIteration& at_iteration = {});

}  // namespace lapservo::internal
