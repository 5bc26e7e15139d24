#include "lapservo/io/video/overlay_writer.h"

#include <optional>
#include <system_error>

#include "lapservo/core/error.h"
#include "lapservo/core/new_folder.h"
#include "lapservo/core/output_target.h"
#include "lapservo/io/image_file.h"
#include "lapservo/io/video/video_writer.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

class PictureOverlay : public OverlayWriter {
 public:
  explicit PictureOverlay(const fs::path& path) : path_(OutputTarget(path).name) {}
  void add(const Frame&, const cv::Mat& overlay) override { write_image(path_, overlay); }
  void commit() override {}

 private:
  fs::path path_;
};

class FolderOverlay : public OverlayWriter {
 public:
  explicit FolderOverlay(const fs::path& folder) : folder_(folder) {}
  void add(const Frame& frame, const cv::Mat& overlay) override {
    fs::path path = folder_.path() / frame.file.filename();
    if (!is_written(path)) path += ".png";
    write_image(path, overlay);
  }
  void commit() override {}

 private:
  NewFolder folder_;
};

class VideoOverlay : public OverlayWriter {
 public:
  VideoOverlay(const fs::path& path, double fps) : video_(path, fps) {}
  void add(const Frame& frame, const cv::Mat& overlay) override {
    if (!start_s_) start_s_ = frame.time_s;
    video_.add(overlay, frame.time_s - *start_s_);
  }
  void commit() override { video_.commit(); }
  bool is_video() const override { return true; }

 private:
  VideoWriter video_;
  std::optional<double> start_s_;  // the first frame's time
};

}  // namespace

std::unique_ptr<OverlayWriter> open_overlay_writer(const fs::path& path, const FrameSource& source) {
  using Kind = FrameSource::Kind;
  std::error_code error;
  if (source.kind() == Kind::image && is_written(path)) return std::make_unique<PictureOverlay>(path);
  if (source.kind() == Kind::image && has_image_extension(path))
    throw InputError(path.string(), "ends like an image that is not written, expected .png or .jpg");
  if (source.kind() == Kind::image || source.kind() == Kind::folder) {
    if (fs::exists(path, error) && !fs::is_directory(path, error))
      throw InputError(path.string(), "is a file, expected a folder for the images");
    return std::make_unique<FolderOverlay>(path);
  }
  if (fs::is_directory(path, error))
    throw InputError(path.string(), "is a folder, expected a video to write, like overlay.mp4");
  return std::make_unique<VideoOverlay>(path, source.frames_per_second());
}

}  // namespace lapservo::internal
