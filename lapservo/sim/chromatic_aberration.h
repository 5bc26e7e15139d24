#pragma once

#include <opencv2/core.hpp>

#include "lapservo/geometry/camera.h"

namespace lapservo::internal {

/// How far a camera's lateral chromatic aberration moves a channel at most, in px, with what its interpolation reads
/// beyond; 0 without one.
int aberration_reach_px(const Camera& camera);

/// Writes the pixels of `part` as the camera's lateral chromatic aberration shows `light` into `out`. Both images are
/// CV_32FC3, the size of the camera's. Without an aberration it copies them.
void aberrate(const Camera& camera, const cv::Mat& light, const cv::Rect& part, cv::Mat& out);

}  // namespace lapservo::internal
