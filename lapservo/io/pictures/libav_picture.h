#pragma once

#include <cstdint>
#include <span>

#include "lapservo/io/pictures/jpeg_picture.h"

namespace lapservo::internal {

/// A BMP, PNM or WebP by FFmpeg's decoders: grey or BGR of 8 or 16 bits, alpha dropped. Empty when the decoder
/// complains or leaves out pixels, and for other formats.
DecodedPicture libav_decode(std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
