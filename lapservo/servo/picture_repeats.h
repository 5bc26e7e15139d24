#pragma once

#include <opencv2/core.hpp>

#include "lapservo/control/image_measurement.h"

namespace lapservo::internal {

/// Detects by its pixels an image that arrives again, whatever its stamp. Noise never repeats exactly: where successive
/// images differ in most places, far from any instrument, an identical one is not of an instrument at rest. A camera
/// without noise, which shows the same places alike while others change, may repeat without being detected.
class PictureRepeats {
 public:
  /// The next image; kept until the one after it, and not changed by anybody.
  Repetition add(const cv::Mat& bgr);

 private:
  cv::Mat before_;
  int noisy_ = 0;      ///< images that differed from the one before in most places, at most 10
  int noiseless_ = 0;  ///< that did not, at most 3: one may have been covered, or black
};

}  // namespace lapservo::internal
