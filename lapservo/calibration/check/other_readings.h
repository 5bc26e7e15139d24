#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Where most of these frames, 8-bit BGR, show an instrument when they are read otherwise (red and blue exchanged,
/// mirrored) or when the rig's hues, diameter, lens or focal length are others: the cause and its remedy. Else empty.
std::string found_otherwise(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced);

/// Whether most of these frames show q when they are turned by 180 degrees.
bool shows_q_when_turned(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced);

/// Where most of these frames, 8-bit BGR, show an instrument's colours in their order but with bands that its marker
/// has at no azimuth: one line with the lengths that are seen. Else empty.
std::string seen_other_bands(const std::vector<cv::Mat>& frames, const Rig& rig, bool deinterlaced);

}  // namespace lapservo::internal
