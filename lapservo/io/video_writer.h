#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include <opencv2/core.hpp>

#include "lapservo/core/output_target.h"
#include "lapservo/core/temporary_file.h"

namespace cv {
class VideoWriter;
}

namespace lapservo::internal {

/// A video that appears whole or not at all; its kind goes by the name's ending (.mp4, .avi, .mkv). It must be a
/// regular file, as an index is written in the end. See OutputTarget.
class VideoWriter {
 public:
  /// Throws InputError at once when it can't be written.
  VideoWriter(const std::filesystem::path& path, double frames_per_second);
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  /// 8-bit BGR, all of one size. Throws InputError when there is no encoder for the name's ending.
  void add(const cv::Mat& frame);
  /// Looks at what the encoder, which tells of no errors, has left. Throws InputError when that does not hold every
  /// frame. Without frames there is no video.
  void commit();

 private:
  OutputTarget target_;
  std::optional<TemporaryFile> temporary_;
  double frames_per_second_;
  std::unique_ptr<cv::VideoWriter> writer_;
  int frames_ = 0;
};

}  // namespace lapservo::internal
