#pragma once

#include <opencv2/core.hpp>

#include "lapservo/control/image_measurement.h"

namespace lapservo::internal {

/// Tells a picture that is shown again, whatever its stamp, by its pixels. Noise never repeats exactly: where pictures
/// differ in most places at a time, far from any instrument, the same one again is not of an instrument at rest. A
/// camera without noise, which shows the same places alike while others change, may show one so.
class PictureRepeats {
 public:
  /// The next picture; kept until the one after it, and not changed by anybody.
  Repetition add(const cv::Mat& bgr);

 private:
  cv::Mat before_;
  int noisy_ = 0;      ///< pictures that differed from the one before in most places, at most 10
  int noiseless_ = 0;  ///< that did not, at most 3: one may have been covered, or black
};

}  // namespace lapservo::internal
