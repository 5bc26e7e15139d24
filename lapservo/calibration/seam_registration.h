#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/marker_calibration.h"

namespace lapservo::internal {

/// An arm's joints over time.
struct JointRecording {
  std::vector<double> time_s;
  std::vector<std::array<double, 4>> joints;  ///< as Joints::names has them; rad, rad, m, rad
};

/// A CSV of `time_s` and a column a joint (docs/conventions.md). Throws InputError for columns that are missing,
/// numbers that are none, fewer than two rows and times that do not rise.
JointRecording read_joint_recording(const std::filesystem::path& path, const Joints& joints);

/// Where the seam lies on the instrument.
struct SeamRegistration {
  std::string refusal;  ///< why it can't be told; empty when it can
  double seam_rad = 0, sigma_rad = 0;
  std::size_t frames = 0;  ///< within the recording
};

/// The seam by which the poses of the calibrated marker agree with the joints, on average, the rig's camera_from_rcm,
/// joints and image_delay_s (0 when it has none) taken for right.
SeamRegistration register_seam(const Instrument& instrument, const MarkerCalibration& calibration,
                               const JointRecording& recording);

}  // namespace lapservo::internal
