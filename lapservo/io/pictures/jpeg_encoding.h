#pragma once

#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// A JPEG of grey or BGR pixels of 8 bits, colours at half the resolution (4:2:0). `quality` 1 to 100, as libjpeg has
/// it. Empty for other pixels, and sides beyond 65500.
std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, int quality = 95);

}  // namespace lapservo::internal
