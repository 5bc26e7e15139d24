#pragma once

#include <cstddef>
#include <vector>

#include "lapservo/calibration/calibrated_number.h"
#include "lapservo/calibration/colour/colour_calibration.h"
#include "lapservo/calibration/recording/frame_recording.h"

namespace lapservo::internal {

/// Colours, measured, and in how many frames.
struct ColourMeasurement {
  ColourCalibration calibration;  ///< or its refusal
  std::size_t frames = 0;
  FramesRead read;
};

/// Calibrates by a marker in motion, a live camera's until it is stopped. A response that calibrate camera measured
/// stays without `replace_response`, and any that images are read by as they say themselves. Throws InputError as
/// read_frames().
ColourMeasurement measure_colour(const Rig& rig, std::size_t instrument, const FrameRecording& recording,
                                 bool replace_response, const JobWatch& watch);

/// The hues, in degrees.
std::vector<CalibratedNumber> calibrated_numbers(const Marker& before, const ColourCalibration& calibration);

/// The rig with what was measured: hues to a hundredth of a degree. A response that is another can't go into a camera's
/// own file, which other rigs may name: the camera stands in the rig then.
Rig with_colour(Rig rig, std::size_t instrument, const ColourCalibration& calibration);

}  // namespace lapservo::internal
