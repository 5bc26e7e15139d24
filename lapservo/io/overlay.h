#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"

namespace lapservo {

/// The frame with the measurement drawn in: the marker's outline, its colour boundaries over the visible surface, the
/// centre line with e0..e3, an arrow towards the tip, the RCM's image and the way to it (r) when it lies in the image,
/// the tip with its 95 % ellipse where it is known, and labels with the rotation, its sigma and the features s, r, l,
/// d. For a rejected frame: the status, and in dashes
/// the rejected detection.
cv::Mat draw_overlay(const cv::Mat& bgr, const Rig& rig, const std::vector<Observation>& observations);

}  // namespace lapservo
