#pragma once

#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/marker/decoder.h"
#include "lapservo/rig/rig.h"
#include "lapservo/vision/observation.h"

namespace lapservo::internal {

/// Method::centerline: the paper's Algorithm 1, the baseline to compare with. Segmentation in HSV, morphological
/// opening, the middle line between the shaft's two sides, the colour boundaries where that line crosses them (to the
/// pixel), their cross-ratio, tau by eq. (18). With camera_from_rcm also theta, phi and rho from e0 and e3, and psi =
/// gamma - tau - seam. Sigmas propagate an assumed boundary noise and the registration's covariance through these.
class CenterlineMethod {
 public:
  /// Borrows the rig, whose registrations may change from frame to frame.
  explicit CenterlineMethod(const Rig& rig);

  /// `image_bgr`: 8-bit BGR of the rig's size. One observation per instrument.
  std::vector<Observation> observe(const cv::Mat& image_bgr) const;

 private:
  const Rig& rig_;
  std::vector<CrossRatioDecoder> decoders_;
};

}  // namespace lapservo::internal
