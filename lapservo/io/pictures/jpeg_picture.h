#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// By its first bytes.
inline bool is_jpeg(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 2 && bytes[0] == 0xff && bytes[1] == 0xd8;
}

/// A decoder's result for a file: an image in 8-bit BGR (empty when not even its header could be read), and the first
/// complaint of the decoder (empty: none).
struct DecodedPicture {
  cv::Mat bgr;
  std::string complaint;
};

/// By libjpeg, whose warnings OpenCV swallows, and as check_jpeg() has it.
DecodedPicture decode_jpeg(std::span<const std::uint8_t> bytes);

struct CheckedJpeg {
  std::string complaint;            ///< the decoder's; empty: none
  std::vector<std::uint8_t> clean;  ///< where bytes belong to no block: the JPEG without them (jpeg_strays.h)
};

/// Reads the coefficients only, in a third of the time. Bytes that belong to no block and a missing end marker are no
/// complaint: they cost no pixel.
CheckedJpeg check_jpeg(std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
