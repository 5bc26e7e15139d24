#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// The name of a picture's format that is neither JPEG nor PNG, by its first bytes: "BMP", "PNM" and "TIFF",
/// which libav_decode() reads, "WebP", or one that nothing here reads ("JPEG 2000"); empty for anything else.
std::string rare_format(std::span<const std::uint8_t> bytes);
bool libav_decodes(const std::string& format);

/// A BMP, PNM or TIFF by FFmpeg's decoders: grey, BGR or BGRA of 8 or 16 bits as the file has them (palettes
/// looked up). Empty when the decoder complains, or for what is of no such format.
cv::Mat libav_decode(std::span<const std::uint8_t> bytes);

/// Of 8-bit grey or BGR, as the ending of a name wants it: .bmp, .tif, .tiff, .ppm, .pgm (grey).
/// Empty for other endings and pixels.
std::vector<std::uint8_t> libav_encode(const std::string& extension, const cv::Mat& image);

}  // namespace lapservo::internal
