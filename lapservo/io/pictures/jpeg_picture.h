#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// A decoder's result for a file: an image in 8-bit BGR (empty when not even its header could be read), and the first
/// complaint of the decoder (empty: none).
struct DecodedPicture {
  cv::Mat bgr;
  std::string complaint;
  std::string coarse{};  ///< by coarse_pixels(); then without an image
};

/// By libjpeg, whose warnings OpenCV swallows, and as check_jpeg() has it.
DecodedPicture decode_jpeg(std::span<const std::uint8_t> bytes);

struct CheckedJpeg {
  std::string complaint;            ///< the decoder's; empty: none
  std::vector<std::uint8_t> clean;  ///< where bytes belong to no block: the JPEG without them
};

/// Reads the coefficients only, in a third of the time. Bytes that belong to no block and a missing end marker are no
/// complaint: they cost no pixel.
CheckedJpeg check_jpeg(std::span<const std::uint8_t> bytes);

/// A JPEG of one scan without the bytes that belong to no block, and with an end marker: cameras leave a few bytes
/// before restart markers or the end, or no end marker. nullopt where blocks are missing or were misread: where the
/// coefficients, written anew, are not what the data begin with between one restart and the next, or more than a few
/// bytes follow that.
std::optional<std::vector<std::uint8_t>> jpeg_without_strays(std::span<const std::uint8_t> jpeg);

/// A JPEG of grey or BGR pixels of 8 bits, colours at half the resolution (4:2:0). `quality` 1 to 100, as libjpeg has
/// it. Empty for other pixels, and sides beyond 65500.
std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, int quality = 95);

}  // namespace lapservo::internal
