#pragma once

#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"

namespace lapservo::internal {

/// The relation of two recordings of one motion, independent of the arm's place.
struct DelayMatch {
  double delay_s = 0;  ///< a frame's stamp minus the joints' clock at its exposure
  double score = 0;    ///< the logarithm of how much less is unexplained than there is, over all that the marker does
  /// How much of what the marker does the joints explain at this delay: 0 nothing, 1 all.
  double explained = 0;
  double rho_per_joint = 0;  ///< slope of the insertion
};

/// The delay within +-`reach_s` about `about_s` at which insertion, the axis' speed and the turn about it fit the
/// joints best, and after it, the better ones first, those that explain about as much: a motion that repeats has
/// several. Empty where the recordings share too little at all of them. `rho_m`: each pose's distance from the RCM
/// along its axis.
std::vector<DelayMatch> search_delay(const std::vector<TimedPose>& poses, const std::vector<double>& rho_m,
                                     const JointRecording& recording, double about_s, double reach_s);

}  // namespace lapservo::internal
