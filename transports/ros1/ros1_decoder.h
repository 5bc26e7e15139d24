#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// A message of ROS 1's type as it stands on the wire and in bags, decoded; nothing for bytes that are no such message:
/// cut short, left over, or of lengths that point beyond them. Nothing is reserved for lengths that aren't there. A
/// stamp that is none is NaN.
template <typename Message>
std::optional<Message> decode_ros1(std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
