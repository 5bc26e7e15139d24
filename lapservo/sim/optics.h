#pragma once

#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// Gaussian blur of an image of light (CV_32FC3), one row of a part at a time, so that only what changed is blurred.
/// Beyond the image's border its outermost pixels go on.
class Optics {
 public:
  explicit Optics(double blur_px);

  /// How far a pixel's light spreads.
  int reach_px() const { return static_cast<int>(weights_.size()) - 1; }
  /// Blurred pixels `begin` to `end` (exclusive) of row v, three floats each; valid until the next call.
  const float* row(const cv::Mat& light, int v, int begin, int end);

 private:
  std::vector<float> weights_;  // of the middle and of the neighbours on one side
  std::vector<float> column_, row_;
};

}  // namespace lapservo::internal
