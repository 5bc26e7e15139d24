#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/calibration/calibrated_number.h"
#include "lapservo/calibration/marker/marker_calibration.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/calibration/recording/joint_recording.h"

namespace lapservo::internal {

/// A print, measured.
struct MarkerMeasurement {
  MarkerCalibration calibration;  ///< or its refusal
  int found = 0;                  ///< frames with the marker in it
  FramesRead read;
};

/// A further result with joints: the place of the seam.
struct JointsOfTurn {
  JointRecording recording;
  std::string source;  ///< for complaints
};

/// Calibrates by some hundred frames of a rotation about the shaft's axis. Throws InputError as read_frames(), and
/// naming the joints' source where they don't determine the seam.
MarkerMeasurement measure_marker(const Rig& rig, std::size_t instrument, const FrameRecording& recording,
                                 const std::optional<JointsOfTurn>& joints, const JobWatch& watch);

/// Throws InputError naming `rig` when the instrument lacks what the seam is measured through.
void expect_registration(const Instrument& instrument, const std::string& rig, const std::string& joints_option);

/// In mm and mrad.
std::vector<CalibratedNumber> calibrated_numbers(const Marker& before, const Marker& after, bool with_seam);

}  // namespace lapservo::internal
