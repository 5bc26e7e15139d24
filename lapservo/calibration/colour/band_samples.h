#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"
#include "lapservo/marker/marker.h"
#include "lapservo/vision/shaft/shaft_pose.h"

namespace lapservo::internal {

/// A pixel well inside a band of a marker.
struct BandSample {
  std::size_t band;  ///< 0..2
  std::array<std::uint8_t, 3> bgr;
};

/// Samples of the side that faces the camera, clear of boundaries and apparent contours by `clear_px`; `bgr` is 8-bit,
/// of the camera's size.
std::vector<BandSample> band_samples(const cv::Mat& bgr, const Camera& camera, const Marker& marker,
                                     const ShaftPose& pose, double clear_px = 3);

/// How a marker is lit in a frame, by encoded values.
struct MarkerLight {
  double clipped = 0;                ///< fraction of the pixels that have a saturated channel
  double value = 0;                  ///< median of the brightest channel, of 255
  double chroma = 0;                 ///< median of the brightest channel less the darkest one
  std::array<double, 3> hues_deg{};  ///< of the bands: medians of what has a hue, near the marker's own
};

/// Median colour of at least one sample.
MarkerLight light_of(const std::vector<BandSample>& samples, const Marker& marker);

}  // namespace lapservo::internal
