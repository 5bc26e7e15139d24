#include "lapservo/io/overlay_writer.h"

#include <system_error>
#include <unistd.h>

#include <opencv2/videoio.hpp>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/io/image_file.h"

namespace lapservo {
namespace {
namespace fs = std::filesystem;

void check_writable_folder(const fs::path& folder, const fs::path& path) {
  if (!fs::is_directory(folder) || ::access(folder.c_str(), W_OK) != 0)
    throw InputError(path.string(), "can't be written: its folder does not exist or is read-only");
}

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

class PictureOverlay : public OverlayWriter {
 public:
  explicit PictureOverlay(fs::path path) : path_(std::move(path)) { check_writable_folder(folder_of(path_), path_); }
  void add(const Frame&, const cv::Mat& overlay) override { write_image(path_, overlay); }
  void commit() override {}

 private:
  fs::path path_;
};

class FolderOverlay : public OverlayWriter {
 public:
  explicit FolderOverlay(fs::path folder) : folder_(std::move(folder)) {
    std::error_code error;
    created_ = fs::create_directories(folder_, error);
    check_writable_folder(folder_, folder_);
  }
  ~FolderOverlay() override {
    std::error_code ignored;
    if (created_ && fs::is_empty(folder_, ignored)) fs::remove(folder_, ignored);
  }
  void add(const Frame& frame, const cv::Mat& overlay) override {
    write_image(folder_ / frame.file.filename(), overlay);
  }
  void commit() override {}

 private:
  fs::path folder_;
  bool created_ = false;
};

class VideoOverlay : public OverlayWriter {
 public:
  VideoOverlay(fs::path path, double fps) : path_(std::move(path)), temporary_(temporary_name(path_)), fps_(fps) {
    check_writable_folder(folder_of(path_), path_);
  }
  ~VideoOverlay() override {
    writer_.release();
    std::error_code ignored;
    fs::remove(temporary_, ignored);
  }
  void add(const Frame&, const cv::Mat& overlay) override {
    if (!writer_.isOpened()) {
      writer_.open(temporary_.string(), cv::VideoWriter::fourcc('m', 'p', '4', 'v'), fps_, overlay.size());
      if (!writer_.isOpened())
        throw InputError(path_.string(), "can't be written as a video, expected a name like overlay.mp4");
    }
    writer_.write(overlay);
  }
  void commit() override {
    writer_.release();
    std::error_code error;
    if (fs::exists(temporary_)) fs::rename(temporary_, path_, error);
    if (error) throw InputError(path_.string(), "can't be written: " + error.message());
  }

 private:
  fs::path path_, temporary_;
  double fps_;
  cv::VideoWriter writer_;
};

}  // namespace

std::unique_ptr<OverlayWriter> open_overlay_writer(const fs::path& path, const FrameSource& source) {
  using Kind = FrameSource::Kind;
  if (source.kind() == Kind::image && has_image_extension(path)) return std::make_unique<PictureOverlay>(path);
  if (source.kind() == Kind::image || source.kind() == Kind::folder) {
    if (fs::exists(path) && !fs::is_directory(path))
      throw InputError(path.string(), "is a file, expected a folder for the pictures");
    return std::make_unique<FolderOverlay>(path);
  }
  if (fs::is_directory(path))
    throw InputError(path.string(), "is a folder, expected a video to write, like overlay.mp4");
  return std::make_unique<VideoOverlay>(path, source.frames_per_second());
}

}  // namespace lapservo
