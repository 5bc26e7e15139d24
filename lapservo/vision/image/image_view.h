#pragma once

#include <cstddef>
#include <cstdint>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// A borrowed 8-bit BGR image.
struct ImageView {
  const std::uint8_t* data = nullptr;
  std::ptrdiff_t row_bytes = 0;
  int width_px = 0, height_px = 0;

  explicit ImageView(const cv::Mat& bgr)
      : data(bgr.data), row_bytes(static_cast<std::ptrdiff_t>(bgr.step[0])), width_px(bgr.cols), height_px(bgr.rows) {}

  const std::uint8_t* pixel(int u, int v) const { return data + v * row_bytes + 3 * static_cast<std::ptrdiff_t>(u); }
};

}  // namespace lapservo::internal
