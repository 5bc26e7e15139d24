#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// By libwebp: of damaged pictures with loss FFmpeg's decoder takes a quarter more for whole. BGR, alpha dropped; empty
/// when it complains.
cv::Mat decode_webp(std::span<const std::uint8_t> bytes);

/// 8-bit BGR, without loss.
std::vector<std::uint8_t> encode_webp(const cv::Mat& bgr);

}  // namespace lapservo::internal
