#pragma once

#include <array>
#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"

namespace lapservo::internal {

/// The relation of two recordings of one motion, independent of the arm's place.
struct DelaySearch {
  double delay_s = 0;  ///< a frame's stamp minus the joints' clock at its exposure
  /// How much of what the marker does the joints explain at this delay: 0 nothing, 1 all.
  double explained = 0;
  double rho_per_joint = 0;  ///< slope of the insertion
};

/// The delay within +-`reach_s` about `about_s` at which insertion, the axis' speed and the turn about it fit the
/// joints best. `rho_m`: each pose's distance from the RCM along its axis.
DelaySearch search_delay(const std::vector<TimedPose>& poses, const std::vector<double>& rho_m,
                         const JointRecording& recording, double about_s, double reach_s);

}  // namespace lapservo::internal
