#include "lapservo/io/live_source.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <filesystem>
#include <linux/videodev2.h>
#include <system_error>
#include <utility>

#include <opencv2/imgproc.hpp>

#include "lapservo/core/error.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/video_reader.h"

namespace lapservo::internal {
namespace {

constexpr std::chrono::seconds patience(30);

class LiveSource : public FrameSource {
 public:
  std::optional<Frame> next() override {
    auto image = first_ ? std::exchange(first_, std::nullopt) : read();
    if (!image) return std::nullopt;
    const auto now = std::chrono::steady_clock::now();
    if (index_ == 0) start_ = now;
    Frame frame{std::move(image->bgr), index_, std::chrono::duration<double>(now - start_).count(), {}, {}};
    if (image->damaged) frame.flaw = Status::damaged;
    ++index_;
    return frame;
  }
  Kind kind() const override { return Kind::live; }
  std::optional<int> frame_count() const override { return std::nullopt; }

 protected:
  using Image = VideoReader::Image;
  virtual std::optional<Image> read() = 0;
  // By whoever derives, once it can be read.
  void begin(const std::string& name) {
    first_ = read();
    if (!first_) throw InputError(name, "gives no frames, expected a camera or stream");
  }

 private:
  std::optional<Image> first_;
  int index_ = 0;
  std::chrono::steady_clock::time_point start_;
};

class StreamSource : public LiveSource {
 public:
  explicit StreamSource(const std::string& name) : stream_(name, patience, VideoReader::Kind::stream) { begin(name); }
  double frames_per_second() const override { return stream_.frames_per_second(); }

 private:
  std::optional<Image> read() override { return stream_.next(); }

  VideoReader stream_;
};

class CameraSource : public LiveSource {
 public:
  explicit CameraSource(const std::string& device) : device_(device, std::nullopt) { begin(device); }
  double frames_per_second() const override {
    constexpr double usual = 30;
    const double told = device_.layout().frames_per_second;
    return told > 0 ? told : usual;
  }

 private:
  std::optional<Image> read() override {
    cv::Mat bgr;
    const auto deadline = std::chrono::steady_clock::now() + patience;
    while (bgr.empty() && std::chrono::steady_clock::now() < deadline) {
      if (!device_.wait(std::chrono::milliseconds(100))) continue;
      if (!device_.take([&](auto bytes, double) { bgr = bgr_of(device_.layout(), bytes); }).empty())
        return std::nullopt;
    }
    return bgr.empty() ? std::nullopt : std::optional(Image{std::move(bgr), false});
  }

  V4l2Device device_;
};

bool is_index(const std::string& input) {
  return !input.empty() && input.size() < 4 &&
         std::all_of(input.begin(), input.end(), [](unsigned char c) { return std::isdigit(c); });
}

cv::Mat converted(const cv::Mat& pixels, int conversion) {
  cv::Mat bgr;
  cv::cvtColor(pixels, bgr, conversion);
  return bgr;
}

cv::Mat decoded(std::span<const std::uint8_t> jpeg) {
  try {
    return decode_image(jpeg, "camera");
  } catch (const InputError&) {
    return {};
  }
}

std::size_t bytes_a_pixel(std::uint32_t format) {
  switch (format) {
    case V4L2_PIX_FMT_BGR24:
    case V4L2_PIX_FMT_RGB24:
      return 3;
    case V4L2_PIX_FMT_YUYV:
    case V4L2_PIX_FMT_UYVY:
      return 2;
    case V4L2_PIX_FMT_NV12:
      return 1;  // of brightness
    default:
      return 0;
  }
}

// Whether all rows are there; the last one need not be padded. Colours of two pixels, or of four, are one.
bool is_whole(const V4l2Layout& layout, std::size_t rows, std::size_t bytes) {
  const std::size_t row = layout.width * bytes_a_pixel(layout.pixel_format);
  const bool colors_shared = layout.pixel_format != V4L2_PIX_FMT_BGR24 && layout.pixel_format != V4L2_PIX_FMT_RGB24;
  const bool even = layout.width % 2 == 0 && (layout.pixel_format != V4L2_PIX_FMT_NV12 || layout.height % 2 == 0);
  return row > 0 && rows > 0 && layout.step >= row && (even || !colors_shared) &&
         bytes >= (rows - 1) * layout.step + row;
}

}  // namespace

cv::Mat bgr_of(const V4l2Layout& layout, std::span<const std::uint8_t> bytes) {
  const int width = static_cast<int>(layout.width), height = static_cast<int>(layout.height);
  const bool is_nv12 = layout.pixel_format == V4L2_PIX_FMT_NV12;
  const bool is_jpeg = layout.pixel_format == V4L2_PIX_FMT_MJPEG || layout.pixel_format == V4L2_PIX_FMT_JPEG;
  if (is_jpeg) return decoded(bytes);
  const std::size_t rows = is_nv12 ? layout.height + layout.height / 2 : layout.height;
  if (!is_whole(layout, rows, bytes.size())) return {};
  auto* const data = const_cast<std::uint8_t*>(bytes.data());
  const auto pixels = [&](int type) { return cv::Mat(height, width, type, data, layout.step); };
  switch (layout.pixel_format) {
    case V4L2_PIX_FMT_BGR24:
      return pixels(CV_8UC3).clone();
    case V4L2_PIX_FMT_RGB24:
      return converted(pixels(CV_8UC3), cv::COLOR_RGB2BGR);
    case V4L2_PIX_FMT_YUYV:
      return converted(pixels(CV_8UC2), cv::COLOR_YUV2BGR_YUY2);
    case V4L2_PIX_FMT_UYVY:
      return converted(pixels(CV_8UC2), cv::COLOR_YUV2BGR_UYVY);
    case V4L2_PIX_FMT_NV12: {
      cv::Mat bgr;
      const cv::Mat colors(height / 2, width / 2, CV_8UC2, data + std::size_t{layout.step} * layout.height,
                           layout.step);
      cv::cvtColorTwoPlane(pixels(CV_8UC1), colors, bgr, cv::COLOR_YUV2BGR_NV12);
      return bgr;
    }
    default:
      return {};
  }
}

bool is_live(const std::string& input) {
  if (input.find("://") != std::string::npos || input.starts_with("/dev/video")) return true;
  std::error_code error;
  return is_index(input) && !std::filesystem::exists(input, error);
}

std::unique_ptr<FrameSource> open_live_source(const std::string& input) {
  if (input.find("://") != std::string::npos) return std::make_unique<StreamSource>(input);
  return std::make_unique<CameraSource>(is_index(input) ? "/dev/video" + input : input);
}

}  // namespace lapservo::internal
