#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/marker/marker_calibration.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/calibration/recording/joint_recording.h"

namespace lapservo::internal {

/// Calibrates by some hundred frames of a rotation about the shaft's axis; with joints the place of the seam, too.
/// Throws InputError as read_frames(), and naming the joints' source where they don't determine the seam.
MarkerCalibration measure_marker(const Rig& rig, std::size_t instrument, const FrameRecording& recording,
                                 const std::optional<JointInput>& joints, const JobWatch& watch);

/// Throws InputError naming `rig` when the instrument lacks what the seam is measured through.
void expect_registration(const Instrument& instrument, const std::string& rig, const std::string& joints_option);

/// In mm and mrad.
std::vector<CalibratedNumber> calibrated_numbers(const Marker& before, const Marker& after, bool with_seam);

/// Where the seam lies on the instrument.
struct SeamRegistration {
  std::string refusal;  ///< the reason why it is not observable; empty when it is
  double seam_rad = 0, sigma_rad = 0;
  std::size_t frames = 0;  ///< within the recording
};

/// The seam by which the poses of the calibrated marker agree with the joints, on average, the rig's camera_from_rcm
/// and joints taken for right. The joints' offset lies in the middle of roll's gap, which a turn there and back shows;
/// of a turn one way the sigma counts half of a usual gap. An error of image_delay_s shows likewise: one way
/// the sigma counts sigma_image_delay_s (0 without one), and a rig without image_delay_s is refused.
SeamRegistration register_seam(const Instrument& instrument, const MarkerCalibration& calibration,
                               const JointRecording& recording);

}  // namespace lapservo::internal
