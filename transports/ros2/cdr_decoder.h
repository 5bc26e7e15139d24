#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// A message of ROS 2's type as it stands in bags: XCDR1 of either byte order behind four bytes that say which. Nothing
/// for bytes that are no such message: cut short, left over, or of lengths that point beyond them. Nothing is reserved
/// for lengths that aren't there. A stamp that is none is NaN.
template <typename Message>
std::optional<Message> decode_cdr(std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
