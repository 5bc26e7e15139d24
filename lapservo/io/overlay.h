#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"

namespace lapservo {

/// The frame with what was observed drawn in: the marker's outline, its colour boundaries over the visible surface, the
/// centre line with e0..e3, an arrow towards the tip, the RCM's image and the way to it (r) when it lies in the
/// picture, and labels with the rotation, its sigma and the features s, r, l, d. Of a refused frame: why, and in dashes
/// what was taken for the marker.
cv::Mat draw_overlay(const cv::Mat& bgr, const Rig& rig, const std::vector<Observation>& observations);

}  // namespace lapservo
