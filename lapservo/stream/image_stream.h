#pragma once

#include <optional>

#include <opencv2/core.hpp>

namespace lapservo {

struct StampedImage {
  /// On the loop's clock: the middle of the exposure if that is known (set ObserverConfig::delay_s to 0 then), else
  /// when it arrived (leave delay_s empty: the delay is estimated). The same for all images of a run.
  double time_s = 0;
  cv::Mat bgr;  ///< 8-bit BGR of the rig's size; not changed by anybody afterwards
};

/// The port to a camera. newest() is called by one thread only, the one that tracks, and must not block: what waits for
/// the camera does so in a thread of its own, and drops what nobody fetched.
class ImageStream {
 public:
  virtual ~ImageStream() = default;
  /// The newest image that came since the last call, if any.
  virtual std::optional<StampedImage> newest() = 0;
  /// By the loop's thread: true once when another camera's images come beside this one's, or after them. The loop holds
  /// then until a start.
  virtual bool take_second_sender() { return false; }
};

}  // namespace lapservo
