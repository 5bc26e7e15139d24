#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// A message of ROS 2's type as it stands in bags: XCDR1 of either byte order behind four bytes that say which. Nothing
/// for bytes that are no such message: cut short, left over, or of lengths that point beyond them. Nothing is reserved
/// for lengths that aren't there. A stamp that is none is NaN.
template <typename Message>
std::optional<Message> decode_cdr(std::span<const std::uint8_t> bytes);

/// A message's bytes as ROS 2 records and sends them: OMG's CDR, XCDR1, little-endian, behind four bytes that say so.
/// Stamps must be numbers. Velocities and efforts are left empty.
template <typename Message>
std::vector<std::uint8_t> encode_cdr(const Message& message);

}  // namespace lapservo::internal
