#pragma once

#include <cstdint>
#include <span>
#include <string>

#include <opencv2/core.hpp>

namespace lapservo::internal {

/// What a decoder made of a file: a picture in 8-bit BGR (empty when not even its header could be read), and the first
/// thing it complained of (empty: nothing).
struct DecodedPicture {
  cv::Mat bgr;
  std::string complaint;
};

/// By libjpeg, whose warnings OpenCV swallows, and as jpeg_complaint() has it.
DecodedPicture decode_jpeg(std::span<const std::uint8_t> bytes);

/// What it complains of when it reads the coefficients only, in a third of the time; or, where it has no complaint,
/// what can't come from a camera: colours that are shifted from some block on (jpeg_dc_shift.h).
std::string jpeg_complaint(std::span<const std::uint8_t> bytes);

}  // namespace lapservo::internal
