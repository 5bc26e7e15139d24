#pragma once

#include <string>
#include <variant>

#include <opencv2/core.hpp>

#include "lapservo/crtk/messages.h"

namespace lapservo::internal {

/// Why an image can't be used, in words.
struct BadImage {
  std::string why;
};
using DecodedImage = std::variant<cv::Mat, BadImage>;

/// 8-bit BGR of bgr8, rgb8, bgra8, rgba8, bgr16, rgb16 (the upper byte), yuv422 (UYVY; also uyvy, yuv422_yuy2, yuyv),
/// nv12 and bayer_*8 or bayer_*16 images, whatever their step and byte order. mono8 and mono16 are refused: the marker
/// has to have colours. At most 16384 pixels wide and high. bgr8 without padding keeps the message's bytes.
DecodedImage decode(ImageMessage message);

/// The same of a compressed one: JPEG, PNG or what else decode_image() reads, whole and undamaged.
DecodedImage decode(const CompressedImageMessage& message);

/// The message of an 8-bit BGR image, in camera_frame.
ImageMessage bgr8_message(const cv::Mat& bgr, double stamp_s);

}  // namespace lapservo::internal
