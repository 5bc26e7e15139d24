#include "lapservo/io/webp_picture.h"

#include <cstddef>
#include <webp/decode.h>
#include <webp/encode.h>

namespace lapservo::internal {

cv::Mat decode_webp(std::span<const std::uint8_t> bytes) {
  int width = 0, height = 0;
  if (WebPGetInfo(bytes.data(), bytes.size(), &width, &height) == 0) return {};
  cv::Mat bgr(height, width, CV_8UC3);
  const int step = static_cast<int>(bgr.step);
  const bool decoded = WebPDecodeBGRInto(bytes.data(), bytes.size(), bgr.data, bgr.step * bgr.rows, step) != nullptr;
  return decoded ? bgr : cv::Mat();
}

std::vector<std::uint8_t> encode_webp(const cv::Mat& bgr) {
  std::uint8_t* written = nullptr;
  const std::size_t size = WebPEncodeLosslessBGR(bgr.data, bgr.cols, bgr.rows, static_cast<int>(bgr.step), &written);
  std::vector<std::uint8_t> bytes(written, written + size);
  WebPFree(written);
  return bytes;
}

}  // namespace lapservo::internal
