#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// A PNG of grey, BGR or BGRA pixels of 8 or 16 bits; written fast rather than small. Empty for other pixels.
std::vector<std::uint8_t> encode_png(const cv::Mat& image);

}  // namespace lapservo::internal
