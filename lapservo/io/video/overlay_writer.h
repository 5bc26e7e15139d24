#pragma once

#include <filesystem>
#include <optional>

#include <opencv2/core.hpp>

#include "lapservo/core/new_folder.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/io/video/video_writer.h"

namespace lapservo::internal {

/// Where `--overlay PATH` goes: an image for an image (when PATH ends like one), a folder of images for images, a
/// video for videos and cameras. Images appear whole, one by one; a video when committed.
class OverlayWriter {
 public:
  /// Throws InputError at once when PATH can't be written.
  OverlayWriter(const std::filesystem::path& path, const FrameSource& source);

  void add(const Frame& frame, const cv::Mat& overlay);
  void commit();
  bool is_video() const { return video_.has_value(); }

 private:
  std::filesystem::path picture_;  // of these three one
  std::optional<NewFolder> folder_;
  std::optional<VideoWriter> video_;
  std::optional<double> start_s_;  // the first frame's time
};

}  // namespace lapservo::internal
