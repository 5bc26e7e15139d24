#pragma once

#include <cstdint>
#include <span>

#include "lapservo/io/pictures/jpeg_picture.h"

namespace lapservo::internal {

/// By libpng, every checksum compared: grey repeated over the channels, palettes looked up, alpha dropped, 16 bits
/// rounded to 8.
DecodedPicture decode_png(std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
