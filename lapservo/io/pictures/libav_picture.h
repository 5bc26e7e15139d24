#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// The name of a format that libav_decode() reads, by an image's first bytes: "BMP", "PNM", "TIFF", "WebP"; empty for
/// anything else.
std::string libav_format(std::span<const std::uint8_t> bytes);

/// A BMP, PNM, TIFF or WebP by FFmpeg's decoders: grey or BGR of 8 or 16 bits, palettes looked up, alpha dropped. Empty
/// when the decoder complains or leaves out pixels, and for other formats.
cv::Mat libav_decode(std::span<const std::uint8_t> bytes);

/// Encodes 8-bit grey or BGR without loss, by the ending of a name: .bmp, .tif, .tiff, .webp, .ppm, .pgm (grey). Empty
/// for other endings and pixels.
std::vector<std::uint8_t> libav_encode(const std::string& extension, const cv::Mat& image);

}  // namespace lapservo::internal
