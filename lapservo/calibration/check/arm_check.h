#pragma once

#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/calibration/registration/timed_pose.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// A number from a recording, and one standard deviation of it.
struct Told {
  double value = 0, sigma = 0;
  /// Larger than `limit`, and by more than chance makes it.
  bool exceeds(double limit) const { return value > limit && value > 4 * sigma; }
};

/// One frame: the marker as it is seen against where the rig and the joints have it.
struct ArmResidual {
  double time_s;
  double pixel_px;  ///< between both images of the marker's middle
  double position_m, axis_rad, roll_rad;
};

/// psi at a frame's time, as the rig's own tracker has it, through its RCM.
struct TrackedPsi {
  double time_s, psi_rad;
};

/// The faults of a rig by a recording of a marker in motion and of its arm's joints: the displacement of the expected
/// marker by each fault alone, the others removed. Values are sizes, none below 0.
struct ArmCheck {
  /// The reason why it is not observable, and the remedy: then the other fields are void. Empty when it is observable.
  std::string refusal;
  std::string region;                        ///< between which readings each joint moved: all of this holds there
  std::vector<ArmResidual> by_rig, at_best;  ///< as the rig has it, and as it would after a calibration
  /// How many times the images' noise residuals are after a calibration: in the image, about the axis, anywhere.
  double noise_across = 1, noise_roll = 1, noise = 1;
  std::string fault;                       ///< of the joints' readings, that explains a large one; empty when none does
  std::vector<TrackedPsi> beyond_encoder;  ///< psi as it is tracked less what the joints say, in [-pi, pi)
  Told focal;                              ///< relative error of the focal length
  Told drift_m, drift_rad;                 ///< of the marker, over the recording, and of the directions
  std::optional<Told> delay_s;             ///< error of the rig's image_delay_s, when it has one
  double measured_delay_s = 0;
  /// camera_from_rcm and joints: rms over the frames of where they put the marker, at its place, direction and turn.
  std::optional<Told> place_m, axis_rad, roll_rad;
  std::vector<std::string> other_signs;  ///< of joints whose sign is not the rig's
};

/// Needs TimedPose::by_focal for `focal`. Throws as register_arm() does. Where the instrument has no camera_from_rcm,
/// what compares with it is empty.
ArmCheck check_arm(const Instrument& instrument, const Camera& camera, const std::vector<TimedPose>& poses,
                   const std::vector<TrackedPsi>& tracked, const JointRecording& recording, const std::string& source);

}  // namespace lapservo::internal
