#pragma once

#include <cstdint>
#include <span>
#include <string>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// A decoder's result for a file: an image in 8-bit BGR (empty when not even its header could be read), and the first
/// complaint of the decoder (empty: none).
struct DecodedPicture {
  cv::Mat bgr;
  std::string complaint;
};

/// By libjpeg, whose warnings OpenCV swallows, and as jpeg_complaint() has it.
DecodedPicture decode_jpeg(std::span<const std::uint8_t> bytes);

/// The decoder's complaint when it reads the coefficients only, in a third of the time; or, without a complaint, a
/// defect that no camera makes: colours that are shifted from some block on (jpeg_dc_shift.h).
std::string jpeg_complaint(std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
