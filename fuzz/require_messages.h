#pragma once

#include <cstdint>
#include <span>

#include "fuzz/require.h"
#include "lapservo/crtk/messages.h"

namespace lapservo::fuzz {

/// Joints and images that `decode.operator()<Message>(bytes)` makes hold no more than the bytes do.
template <typename Decode>
void require_messages_within(const Decode& decode, std::span<const std::uint8_t> bytes) {
  using namespace internal;
  if (const auto joints = decode.template operator()<JointMessage>(bytes))
    require(4 * joints->names.size() + 8 * joints->positions.size() <= bytes.size(), "joints are in the bytes");
  if (const auto image = decode.template operator()<ImageMessage>(bytes))
    require(image->data.size() + image->encoding.size() < bytes.size(), "pixels are in the bytes");
  if (const auto image = decode.template operator()<CompressedImageMessage>(bytes))
    require(image->data.size() + image->format.size() < bytes.size(), "an image is in the bytes");
}

}  // namespace lapservo::fuzz
