#include "lapservo/io/frame_source.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <utility>
#include <vector>

#include <opencv2/videoio.hpp>

#include "lapservo/core/error.h"
#include "lapservo/io/image_file.h"

namespace lapservo {
namespace {
namespace fs = std::filesystem;

class PictureSource : public FrameSource {
 public:
  PictureSource(Kind kind, std::vector<fs::path> files, double fps)
      : kind_(kind), files_(std::move(files)), fps_(fps) {}

  std::optional<Frame> next() override {
    if (next_ == files_.size()) return std::nullopt;
    const fs::path& file = files_[next_];
    Frame frame{read_image(file), static_cast<int>(next_), static_cast<double>(next_) / fps_, file};
    ++next_;
    return frame;
  }
  Kind kind() const override { return kind_; }
  std::optional<int> frame_count() const override { return static_cast<int>(files_.size()); }
  double frames_per_second() const override { return fps_; }

 private:
  Kind kind_;
  std::vector<fs::path> files_;
  double fps_;
  std::size_t next_ = 0;
};

class CaptureSource : public FrameSource {
 public:
  CaptureSource(Kind kind, const std::string& name, cv::VideoCapture capture)
      : kind_(kind), name_(name), capture_(std::move(capture)) {
    const double fps = capture_.get(cv::CAP_PROP_FPS);
    if (fps > 0 && fps < 10000) fps_ = fps;
    first_ = read();
    if (!first_) throw InputError(name_, kind_ == Kind::video ? "has no frames, expected a video" : "gives no frames");
  }

  std::optional<Frame> next() override {
    std::optional<cv::Mat> image = first_ ? std::exchange(first_, std::nullopt) : read();
    if (!image) return std::nullopt;
    const auto now = std::chrono::steady_clock::now();
    if (index_ == 0) start_ = now;
    Frame frame{std::move(*image), index_, 0, {}};
    frame.time_s = kind_ == Kind::live ? std::chrono::duration<double>(now - start_).count() : index_ / fps_;
    ++index_;
    return frame;
  }
  Kind kind() const override { return kind_; }
  std::optional<int> frame_count() const override {
    const double count = kind_ == Kind::video ? capture_.get(cv::CAP_PROP_FRAME_COUNT) : 0;
    return count > 0 && count < 1e9 ? std::optional(static_cast<int>(count)) : std::nullopt;
  }
  double frames_per_second() const override { return fps_; }

 private:
  std::optional<cv::Mat> read() {
    cv::Mat image;
    try {
      if (!capture_.read(image) || image.empty()) return std::nullopt;
    } catch (const cv::Exception&) {
      return std::nullopt;
    }
    return bgr8_from(image, name_).clone();
  }

  Kind kind_;
  std::string name_;
  cv::VideoCapture capture_;
  std::optional<cv::Mat> first_;
  double fps_ = 30;
  int index_ = 0;
  std::chrono::steady_clock::time_point start_;
};

std::vector<fs::path> pictures_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const bool hidden = entry.path().filename().string().starts_with(".");
    if (!hidden && entry.is_regular_file() && has_image_extension(entry.path())) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  if (files.empty()) throw InputError(folder.string(), "has no pictures (png, jpg, bmp, tif, webp, ppm)");
  return files;
}

cv::VideoCapture open_capture(const std::string& input, FrameSource::Kind kind) {
  cv::VideoCapture capture;
  try {
    const bool index =
        !input.empty() && std::all_of(input.begin(), input.end(), [](unsigned char c) { return std::isdigit(c); });
    if (index && input.size() < 4) {
      capture.open(std::stoi(input));
    } else {
      capture.open(input);
    }
  } catch (const cv::Exception&) {
    capture.release();
  }
  if (!capture.isOpened())
    throw InputError(input, kind == FrameSource::Kind::video ? "can't be read, expected a picture or a video"
                                                             : "can't be opened as a camera or stream");
  return capture;
}

bool is_live(const std::string& input) {
  if (input.find("://") != std::string::npos || input.starts_with("/dev/video")) return true;
  return !input.empty() && input.size() < 4 && !fs::exists(input) &&
         std::all_of(input.begin(), input.end(), [](unsigned char c) { return std::isdigit(c); });
}

}  // namespace

std::unique_ptr<FrameSource> open_frame_source(const std::string& input, double folder_fps) {
  using Kind = FrameSource::Kind;
  if (is_live(input)) return std::make_unique<CaptureSource>(Kind::live, input, open_capture(input, Kind::live));
  if (!fs::exists(input))
    throw InputError(input, "does not exist, expected a picture, a folder of pictures or a video");
  if (fs::is_directory(input)) return std::make_unique<PictureSource>(Kind::folder, pictures_in(input), folder_fps);
  if (fs::is_regular_file(input) && fs::file_size(input) == 0)
    throw InputError(input, "is empty, expected a picture or a video");
  if (has_image_extension(input))
    return std::make_unique<PictureSource>(Kind::image, std::vector<fs::path>{input}, folder_fps);
  return std::make_unique<CaptureSource>(Kind::video, input, open_capture(input, Kind::video));
}

}  // namespace lapservo
