#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/vision/edges/edge_lines.h"

namespace lapservo::internal {

/// Light along a line across an edge, which is expected in the middle. Each sample has an encoded value of its own, so
/// its light is not rounded.
struct TestProfile {
  int reach, count = 2 * reach + 1;
  std::vector<std::array<float, 3>> light = std::vector<std::array<float, 3>>(static_cast<std::size_t>(count));
  std::array<int, 3> clipped_from{count, count, count};  ///< the first sample that is clipped, per channel
  float clipped_light = 1;

  /// As a step, or as the occluding contour of a cylinder of this radius.
  EdgeFit fit(float blur_px, int iterations, float contour_radius_px = 0) const {
    LightTable table{};
    table[255] = clipped_light;
    cv::Mat image(2, count + 1, CV_8UC3, cv::Scalar::all(0));
    for (int i = 0; i < count; ++i)
      for (int c = 0; c < 3; ++c) {
        const int value = i < clipped_from[static_cast<std::size_t>(c)] ? c * count + i : 255;
        if (value < 255)
          table[static_cast<std::size_t>(value)] = light[static_cast<std::size_t>(i)][static_cast<std::size_t>(c)];
        image.at<cv::Vec3b>(0, i)[c] = static_cast<std::uint8_t>(value);
      }
    const ImageView view(image);
    const EdgeLine line{static_cast<float>(reach), 0, 1, 0, reach, reach, blur_px, contour_radius_px};
    return locate_edges(LightImage(view, table), {&line, 1}, iterations)[0];
  }
};

}  // namespace lapservo::internal
