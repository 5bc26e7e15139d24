#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "lapservo/crtk/messages.h"

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

/// How a device's images lie in its buffers.
struct V4l2Layout {
  std::uint32_t pixel_format = 0, width = 0, height = 0, step = 0;
};
/// A buffer's bytes as a message, copied. For pixel formats that best_offer() takes.
std::variant<ImageMessage, CompressedImageMessage> v4l2_message(const V4l2Layout& layout,
                                                                std::span<const std::uint8_t> bytes, double stamp_s);

}  // namespace lapservo::internal
