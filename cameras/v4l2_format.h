#pragma once

#include <cstdint>
#include <span>
#include <variant>
#include <vector>

#include "lapservo/crtk/messages.h"
#include "lapservo/io/v4l2_device.h"

namespace lapservo::internal {

/// A buffer's bytes as a message, copied. For pixel formats that best_offer() takes.
std::variant<ImageMessage, CompressedImageMessage> v4l2_message(const V4l2Layout& layout,
                                                                std::span<const std::uint8_t> bytes, double stamp_s);

}  // namespace lapservo::internal
