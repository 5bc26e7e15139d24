#include "cameras/v4l2_format.h"

#include <algorithm>
#include <array>
#include <linux/videodev2.h>
#include <string_view>

namespace lapservo::internal {
namespace {

// In the order in which they are preferred, with the names that the decoder knows.
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

std::optional<V4l2Offer> best_offer(const std::vector<V4l2Offer>& offers) {
  std::optional<V4l2Offer> best;
  const auto is_better = [&](const V4l2Offer& offer) {
    constexpr double same = 0.5;  // 29.97 is 30
    const double faster = offer.max_frames_per_second - best->max_frames_per_second;
    if (std::abs(faster) > same) return faster > 0;
    return find(offer.pixel_format) < find(best->pixel_format);
  };
  for (const V4l2Offer& offer : offers)
    if (find(offer.pixel_format) != known.end() && (!best || is_better(offer))) best = offer;
  return best;
}

std::string four_letters(std::uint32_t pixel_format) {
  std::string letters;
  for (int shift = 0; shift < 32; shift += 8) {
    const char letter = static_cast<char>(pixel_format >> shift & 0x7f);
    letters += letter > ' ' && letter <= '~' ? letter : '?';
  }
  return letters;
}

std::variant<ImageMessage, CompressedImageMessage> v4l2_message(const V4l2Layout& layout,
                                                                std::span<const std::uint8_t> bytes, double stamp_s) {
  const std::string encoding(find(layout.pixel_format)->encoding);
  std::vector<std::uint8_t> data(bytes.begin(), bytes.end());
  if (encoding == "jpeg") return CompressedImageMessage{stamp_s, encoding, std::move(data)};
  return ImageMessage{stamp_s, layout.width, layout.height, layout.step, encoding, false, std::move(data)};
}

}  // namespace lapservo::internal
