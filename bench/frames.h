#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/rig/rig.h"
#include "lapservo/sim/renderer.h"

namespace lapservo::bench {

/// The standard rig with its camera scaled to a width of 16:9, and 1 to 3 instruments.
Rig scaled_rig(int width_px, int instruments);

Renderer make_renderer(const Rig& rig);

/// Where the instruments are in frame `index` of a slow motion.
std::vector<ShaftPlacement> placements(const Rig& rig, int index);

/// Frames of that motion, rendered.
std::vector<cv::Mat> moving_frames(const Rig& rig, int count);

/// The background alone.
cv::Mat empty_frame(const Rig& rig);

}  // namespace lapservo::bench
