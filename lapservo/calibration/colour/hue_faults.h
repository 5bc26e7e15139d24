#pragma once

#include <array>
#include <string>
#include <vector>

#include "lapservo/calibration/colour/marker_light.h"
#include "lapservo/marker/marker.h"

namespace lapservo::internal {

/// How a marker's bands look in one frame.
struct FrameHues {
  std::array<double, 3> beyond_deg{};  ///< hues of the bands beyond the marker's
  double value = 0;                    ///< MarkerLight::value
};
FrameHues frame_hues(const MarkerLight& light, const Marker& marker);

/// The hues change over the recording beyond their scatter from frame to frame.
struct HueFault {
  double size_deg;  ///< of the band that changes most
  std::string what, remedy;

  std::string text() const { return what + ": " + remedy; }
};

/// The bands' hues by all frames of a recording.
struct RecordedHues {
  std::array<double, 3> beyond_deg{};  ///< medians of those of the frames
  std::array<double, 3> sigma_deg{};   ///< one standard deviation, which counts the faults
  std::vector<HueFault> faults;        ///< with the time (white balance), then with the brightness (exposure)
};

/// `frames`: at least one, evenly spread over the recording. No faults of fewer than eight.
RecordedHues recorded_hues(std::vector<FrameHues> frames);

}  // namespace lapservo::internal
