#pragma once

#include <cstddef>
#include <string>

#include "lapservo/calibration/marker/marker_calibration.h"
#include "lapservo/calibration/recording/joint_recording.h"

namespace lapservo::internal {

/// Where the seam lies on the instrument.
struct SeamRegistration {
  std::string refusal;  ///< the reason why it is not observable; empty when it is
  double seam_rad = 0, sigma_rad = 0;
  std::size_t frames = 0;  ///< within the recording
};

/// The seam by which the poses of the calibrated marker agree with the joints, on average, the rig's camera_from_rcm,
/// joints and image_delay_s (0 when it has none) taken for right.
SeamRegistration register_seam(const Instrument& instrument, const MarkerCalibration& calibration,
                               const JointRecording& recording);

}  // namespace lapservo::internal
