#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <opencv2/core.hpp>

#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/io/pictures/transfer.h"

namespace lapservo::internal {

/// By libpng, every checksum compared: grey repeated over the channels, alpha dropped, 16 bits rounded to 8, the
/// transfer that it names undone.
DecodedPicture decode_png(std::span<const std::uint8_t> bytes);

/// By its chunks cICP or gAMA; nullopt for what cameras' responses are, and for what is no PNG. Its first bytes
/// suffice.
std::optional<Transfer> png_transfer(std::span<const std::uint8_t> bytes);

/// A PNG of grey, BGR or BGRA pixels of 8 or 16 bits; written fast rather than small. Empty for other pixels.
std::vector<std::uint8_t> encode_png(const cv::Mat& image);

}  // namespace lapservo::internal
