#include "cameras/v4l2_format.h"

#include <algorithm>
#include <array>
#include <linux/videodev2.h>
#include <string_view>

namespace lapservo::internal {
namespace {

// What a V4l2Device takes, with the names that the decoder knows.
struct Known {
  std::uint32_t pixel_format;
  std::string_view encoding;
};
constexpr std::array known{Known{V4L2_PIX_FMT_BGR24, "bgr8"},       Known{V4L2_PIX_FMT_RGB24, "rgb8"},
                           Known{V4L2_PIX_FMT_YUYV, "yuv422_yuy2"}, Known{V4L2_PIX_FMT_UYVY, "yuv422"},
                           Known{V4L2_PIX_FMT_NV12, "nv12"},        Known{V4L2_PIX_FMT_MJPEG, "jpeg"},
                           Known{V4L2_PIX_FMT_JPEG, "jpeg"}};

auto find(std::uint32_t pixel_format) {
  return std::find_if(known.begin(), known.end(), [&](const Known& k) { return k.pixel_format == pixel_format; });
}

}  // namespace

std::variant<ImageMessage, CompressedImageMessage> v4l2_message(const V4l2Layout& layout,
                                                                std::span<const std::uint8_t> bytes, double stamp_s) {
  const std::string encoding(find(layout.pixel_format)->encoding);
  std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
  if (encoding == "jpeg") return CompressedImageMessage{stamp_s, encoding, std::move(data)};
  return ImageMessage{stamp_s, layout.width, layout.height, layout.step, encoding, false, std::move(data)};
}

}  // namespace lapservo::internal
