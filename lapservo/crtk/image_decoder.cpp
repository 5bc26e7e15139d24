#include "lapservo/crtk/image_decoder.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "lapservo/core/error.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/video/yuv_picture.h"

namespace lapservo::internal {
namespace {

constexpr std::uint32_t max_px = 16384;
constexpr std::size_t max_compressed = std::size_t{64} << 20;

// How pixels lie, and what makes BGR of them: one of OpenCV's conversions; keep: they are BGR.
constexpr int keep = -1;
using Layout = YuvPicture::Layout;
struct Encoding {
  std::string_view name;
  int channels, bytes;  // of a channel
  std::variant<int, Layout> conversion;
};
// OpenCV names Bayer patterns by the second row's second and third pixel.
constexpr std::array encodings{
    Encoding{"bgr8", 3, 1, keep},
    Encoding{"8UC3", 3, 1, keep},
    Encoding{"rgb8", 3, 1, cv::COLOR_RGB2BGR},
    Encoding{"bgra8", 4, 1, cv::COLOR_BGRA2BGR},
    Encoding{"rgba8", 4, 1, cv::COLOR_RGBA2BGR},
    Encoding{"bgr16", 3, 2, keep},
    Encoding{"rgb16", 3, 2, cv::COLOR_RGB2BGR},
    Encoding{"yuv422", 2, 1, Layout::uyvy},
    Encoding{"uyvy", 2, 1, Layout::uyvy},
    Encoding{"yuv422_yuy2", 2, 1, Layout::yuyv},
    Encoding{"yuyv", 2, 1, Layout::yuyv},
    Encoding{"nv12", 1, 1, Layout::nv12},  // not in image_encodings.h; as NVIDIA's nodes publish it
    Encoding{"bayer_rggb8", 1, 1, cv::COLOR_BayerBG2BGR},
    Encoding{"bayer_bggr8", 1, 1, cv::COLOR_BayerRG2BGR},
    Encoding{"bayer_gbrg8", 1, 1, cv::COLOR_BayerGR2BGR},
    Encoding{"bayer_grbg8", 1, 1, cv::COLOR_BayerGB2BGR},
    Encoding{"bayer_rggb16", 1, 2, cv::COLOR_BayerBG2BGR},
    Encoding{"bayer_bggr16", 1, 2, cv::COLOR_BayerRG2BGR},
    Encoding{"bayer_gbrg16", 1, 2, cv::COLOR_BayerGR2BGR},
    Encoding{"bayer_grbg16", 1, 2, cv::COLOR_BayerGB2BGR},
};

// The first letters of a word that a stranger sent, without what a terminal would act on.
std::string shown(std::string text) {
  text.resize(std::min<std::size_t>(text.size(), 32));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

BadImage bad_encoding(const std::string& encoding) {
  if (encoding == "mono8" || encoding == "mono16")
    return {encoding + " has no colours, by which the marker is found: publish bgr8, rgb8, yuv422 or bayer_*"};
  return {"encoding " + shown(encoding) +
          ", expected bgr8, rgb8, bgra8, rgba8, bgr16, rgb16, yuv422, yuv422_yuy2, nv12 or bayer_*"};
}

// By the matrix of its height; chroma lies on the left of each two pixels, as cameras send it. Chroma of nv12 lies in
// the rows below luma's.
DecodedImage bgr_of(const cv::Mat& pixels, cv::Size size, Layout layout) {
  const int step = static_cast<int>(pixels.step);
  const YuvPicture picture{layout, size, {pixels.ptr(0), pixels.data + pixels.step * size.height}, {step, step}};
  cv::Mat bgr;
  if (!convert_to_bgr(picture, {usual_matrix(size.height)}, bgr))
    return BadImage{fmt::format("size {}x{}", size.width, size.height)};
  return bgr;
}

// The upper byte of each 16-bit value.
cv::Mat upper_bytes(const cv::Mat& bytes, bool big_endian) {
  cv::Mat upper;
  cv::extractChannel(bytes.reshape(2), upper, big_endian ? 0 : 1);
  return upper;
}

// Frees bytes that an image has from keep_bytes().
class KeptBytes : public cv::MatAllocator {
 public:
  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, std::size_t* step, cv::AccessFlag flags,
                         cv::UMatUsageFlags usage) const override {
    return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
  }
  bool allocate(cv::UMatData* data, cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    return cv::Mat::getStdAllocator()->allocate(data, flags, usage);
  }
  void deallocate(cv::UMatData* data) const override {
    delete static_cast<std::vector<std::uint8_t>*>(data->userdata);
    delete data;
  }
};

// An 8-bit BGR image of these bytes, without a copy: an image of 1920x1080 has 6 MB.
cv::Mat keep_bytes(std::vector<std::uint8_t> bytes, const cv::Size& size) {
  static const KeptBytes allocator;
  auto kept = std::make_unique<std::vector<std::uint8_t>>(std::move(bytes));
  cv::Mat image(size, CV_8UC3, kept->data());
  image.u = new cv::UMatData(&allocator);
  image.u->data = image.u->origdata = kept->data();
  image.u->size = kept->size();
  image.u->refcount = 1;
  image.u->userdata = kept.release();
  return image;
}

}  // namespace

DecodedImage decode(ImageMessage message) {
  const auto found = std::find_if(encodings.begin(), encodings.end(),
                                  [&](const Encoding& known) { return known.name == message.encoding; });
  if (found == encodings.end()) return bad_encoding(message.encoding);
  const auto [width, height, step] = std::array{message.width, message.height, message.step};
  const auto* const layout = std::get_if<Layout>(&found->conversion);
  const bool half_chroma = layout && *layout == Layout::nv12;
  if (width == 0 || height == 0 || width > max_px || height > max_px ||
      ((found->channels == 2 || half_chroma) && width % 2 != 0) || (half_chroma && height % 2 != 0))
    return BadImage{fmt::format("size {}x{}", width, height)};
  const std::size_t row = std::size_t{width} * found->channels * found->bytes;
  const std::uint32_t rows = half_chroma ? height / 2 * 3 : height;
  if (step < row || message.data.size() < std::size_t{step} * (rows - 1) + row)
    return BadImage{
        fmt::format("{} bytes with a step of {} for {}x{} {}", message.data.size(), step, width, height, found->name)};
  const cv::Mat bytes(static_cast<int>(rows), static_cast<int>(row), CV_8UC1,
                      const_cast<std::uint8_t*>(message.data.data()), step);
  cv::Mat pixels = found->bytes == 2 ? upper_bytes(bytes, message.is_bigendian) : bytes;
  pixels = pixels.reshape(found->channels);
  const cv::Size size(static_cast<int>(width), static_cast<int>(height));
  if (layout) return bgr_of(pixels, size, *layout);
  const int conversion = std::get<int>(found->conversion);
  if (conversion == keep)
    return found->bytes == 1 && step == row ? keep_bytes(std::move(message.data), size) : pixels.clone();
  cv::Mat bgr;
  cv::cvtColor(pixels, bgr, conversion);
  return bgr;
}

DecodedImage decode(const CompressedImageMessage& message) {
  if (message.data.size() > max_compressed) return BadImage{fmt::format("{} compressed bytes", message.data.size())};
  try {
    return decode_image(message.data, "compressed image");
  } catch (const InputError& error) {
    return BadImage{shown(message.format) + ", " + error.what()};
  }
}

ImageMessage bgr8_message(const cv::Mat& bgr, double stamp_s) {
  ImageMessage message;
  message.stamp_s = stamp_s;
  message.width = static_cast<std::uint32_t>(bgr.cols);
  message.height = static_cast<std::uint32_t>(bgr.rows);
  message.step = 3 * message.width;
  message.encoding = "bgr8";
  message.frame = camera_frame;
  const cv::Mat whole = bgr.isContinuous() ? bgr : bgr.clone();
  message.data.assign(whole.data, whole.data + whole.total() * whole.elemSize());
  return message;
}

}  // namespace lapservo::internal
