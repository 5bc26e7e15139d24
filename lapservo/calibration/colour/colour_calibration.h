#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/calibration/recording/frame_recording.h"

namespace lapservo::internal {

struct ColourCalibration {
  /// Why there is none, and what to do about it: then nothing else counts. Empty when there is one.
  std::string refusal;
  std::array<double, 3> hues_deg{}, sigma_hues_deg{};  ///< [0, 360); one standard deviation each
  std::optional<Response> response;                    ///< another than the rig's, when the frames say so
  std::string response_found;                          ///< what they say, in words
  std::vector<std::string> faults;  ///< of the frames' colours, that show beyond the noise: the sigmas count them
  int found_before = 0, found = 0;  ///< of the frames
  std::size_t frames = 0;
  FramesRead read;  ///< of measure_colour()
};

/// The hues of a mounted marker's bands as the camera has them, and how it encodes light, from frames of it in motion
/// (8-bit BGR of the rig's size). The rig's hues may be so wrong that it is not found at all: up to 60 degrees each.
/// With keep_response the rig's stays, whatever the frames say: to a marker, sharpening looks like another response,
/// and so does compression, which is named where the frames are `lossy`.
ColourCalibration calibrate_colour(const Rig& rig, std::size_t instrument, const std::vector<cv::Mat>& frames,
                                   bool keep_response = false, bool lossy = false, const JobWatch& watch = {});

/// The frame in grey, with what is one of the rig's colours painted in its hue.
cv::Mat segmentation_picture(const cv::Mat& bgr, const Rig& rig);

/// Calibrates by a marker in motion, a live camera's until it is stopped. A response that calibrate camera measured
/// stays without `replace_response`, and any that images are read by as they say themselves. Throws InputError as
/// read_frames().
ColourCalibration measure_colour(const Rig& rig, std::size_t instrument, const FrameRecording& recording,
                                 bool replace_response, const JobWatch& watch);

/// The hues, in degrees.
std::vector<CalibratedNumber> calibrated_numbers(const Marker& before, const ColourCalibration& calibration);

/// The rig with what was measured: hues to a hundredth of a degree. A response that is another can't go into a camera's
/// own file, which other rigs may name: the camera stands in the rig then.
Rig with_colour(Rig rig, std::size_t instrument, const ColourCalibration& calibration);

}  // namespace lapservo::internal
