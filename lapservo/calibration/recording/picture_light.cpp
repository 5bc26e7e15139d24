#include "lapservo/calibration/recording/picture_light.h"

#include <algorithm>
#include <vector>

#include "lapservo/core/statistics.h"
#include "lapservo/vision/image/light_image.h"

namespace lapservo::internal {

PictureLight light_of_picture(const cv::Mat& bgr) {
  constexpr int every = 16;  // pixels
  std::vector<int> brightest;
  int clipped = 0;
  for (int v = every / 2; v < bgr.rows; v += every)
    for (int u = every / 2; u < bgr.cols; u += every) {
      const auto& pixel = bgr.at<cv::Vec3b>(v, u);
      brightest.push_back(std::max({pixel[0], pixel[1], pixel[2]}));
      clipped += brightest.back() >= LightImage::saturated_value;
    }
  if (brightest.empty()) return {};
  const double share = static_cast<double>(clipped) / static_cast<double>(brightest.size());
  return {static_cast<double>(quantile(brightest, 0.9)), share};
}

}  // namespace lapservo::internal
