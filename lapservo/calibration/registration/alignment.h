#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// The relation of the clock that stamps frames to that of the joints. Sigmas are one standard deviation.
struct Alignment {
  /// Why there is none, and what to do about it: then nothing else counts. Empty when there is one.
  std::string refusal;
  /// A frame's stamp minus the joints' clock at its exposure, in the middle of what both recordings share.
  double delay_s = 0, sigma_delay_s = 0;
  double drift_ppm = 0, sigma_drift_ppm = 0;  ///< how much faster the frames' clock runs
  double shared_s = 0;                        ///< how long both recordings show the motion

  /// The joints as a frame shows them, and as the recording has them at its exposure by the alignment.
  struct Pair {
    double time_s;  ///< the frame's stamp
    std::array<double, 4> seen, read;
  };
  std::vector<Pair> pairs;

  bool drifts() const { return std::abs(drift_ppm) > 3 * sigma_drift_ppm; }
};

/// From poses alone and the joints meanwhile, with clocks up to largest_delay_s (arm_start.h) apart beyond the
/// instrument's delay; the instrument's `joints` names the columns. Refused where too little moves, where the joints do
/// not move as the marker does, and where several delays explain the motion about as well. Throws InputError as
/// start_arm().
Alignment align(const Instrument& instrument, const std::vector<TimedPose>& poses, const JointRecording& recording,
                const std::string& source);

}  // namespace lapservo::internal
