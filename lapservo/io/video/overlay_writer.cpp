#include "lapservo/io/video/overlay_writer.h"

#include <system_error>

#include "lapservo/core/error.h"
#include "lapservo/core/output_target.h"
#include "lapservo/io/image_file.h"

namespace lapservo::internal {
namespace fs = std::filesystem;

OverlayWriter::OverlayWriter(const fs::path& path, const FrameSource& source) {
  using Kind = FrameSource::Kind;
  std::error_code error;
  const bool is_image = source.kind() == Kind::image;
  if (is_image && is_written(path)) {
    picture_ = OutputTarget(path).name;
  } else if (is_image && has_image_extension(path)) {
    throw InputError(path.string(), "ends like an image that is not written, expected .png or .jpg");
  } else if (is_image || source.kind() == Kind::folder) {
    if (fs::exists(path, error) && !fs::is_directory(path, error))
      throw InputError(path.string(), "is a file, expected a folder for the images");
    folder_.emplace(path);
  } else {
    if (fs::is_directory(path, error))
      throw InputError(path.string(), "is a folder, expected a video to write, like overlay.mp4");
    video_.emplace(path, source.frames_per_second());
  }
}

void OverlayWriter::add(const Frame& frame, const cv::Mat& overlay) {
  if (video_) {
    if (!start_s_) start_s_ = frame.time_s;
    return video_->add(overlay, frame.time_s - *start_s_);
  }
  fs::path path = folder_ ? folder_->path() / frame.file.filename() : picture_;
  if (folder_ && !is_written(path)) path += ".png";
  write_image(path, overlay);
}

void OverlayWriter::commit() {
  if (video_) video_->commit();
}

}  // namespace lapservo::internal
