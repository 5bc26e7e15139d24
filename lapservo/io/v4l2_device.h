#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// A way in which a device would send images of the size that is wanted.
struct V4l2Offer {
  std::uint32_t pixel_format = 0;    ///< V4L2_PIX_FMT_*
  double max_frames_per_second = 0;  ///< 0: unknown
};

/// The fastest of those that can be decoded; of equally fast ones what loses and costs least.
std::optional<V4l2Offer> best_offer(const std::vector<V4l2Offer>& offers);

/// "YUYV" of V4L2_PIX_FMT_YUYV.
std::string four_letters(std::uint32_t pixel_format);

/// How a device's images lie in its buffers, and how often they come.
struct V4l2Layout {
  std::uint32_t pixel_format = 0, width = 0, height = 0, step = 0;
  double frames_per_second = 0;  ///< 0: unknown
};

/// A Video4Linux device that streams, in the best of its offers.
class V4l2Device {
 public:
  /// Of this size, or that which it is set to. Throws InputError, naming the device, when it can't be used or has no
  /// such size.
  V4l2Device(const std::string& path, std::optional<cv::Size> size);
  ~V4l2Device();

  const V4l2Layout& layout() const;
  /// Whether an image came within that time.
  bool wait(std::chrono::milliseconds patience) const;
  /// An image's bytes (none of one that was damaged on its way), only during the call, and its stamp of the monotonic
  /// clock, NaN without.
  using Taker = std::function<void(std::span<const std::uint8_t> bytes, double stamp_s)>;
  /// Hands on the next image where there is one. Why none will come any more; empty else.
  std::string take(const Taker& taker);

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace lapservo::internal
