#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"

namespace lapservo {

/// The frame with what was observed drawn in: the marker's outline, its colour boundaries over the visible surface, the
/// centre line with e0..e3, an arrow towards the tip, and a label with the rotation and its sigma, or why there is
/// none.
cv::Mat draw_overlay(const cv::Mat& bgr, const Rig& rig, const std::vector<Observation>& observations);

}  // namespace lapservo
