#pragma once

#include <cstdint>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// A laparoscopic background in linear light (CV_32FC3, b g r): folds of tissue with vessels and wet highlights, darker
/// towards the rim of the endoscope's round field. Deterministic from the seed.
cv::Mat make_tissue(int width_px, int height_px, std::uint64_t seed);

}  // namespace lapservo::internal
