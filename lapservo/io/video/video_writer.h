#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include <opencv2/core.hpp>

#include "lapservo/core/output_target.h"
#include "lapservo/io/video/video_encoder.h"

namespace lapservo::internal {

/// A video that appears whole or not at all, as VideoEncoder writes it; its container goes by the name's ending (.mp4,
/// .avi, .mkv). It must be a regular file, as an index is written in the end. See OutputTarget.
class VideoWriter {
 public:
  /// Throws InputError at once when it can't be written.
  VideoWriter(const std::filesystem::path& path, double frames_per_second, VideoUse use = VideoUse::shown);

  /// 8-bit BGR, all of one size, at VideoEncoder::add()'s times. Throws InputError when there is no encoder for the
  /// name's ending; commit() reports a full disk.
  void add(const cv::Mat& frame, std::optional<double> time_s = std::nullopt);
  /// Throws InputError when the file does not hold every frame in the end. Without frames there is no video.
  void commit();

 private:
  OutputTarget target_;
  std::optional<TemporaryFile> temporary_;
  double frames_per_second_;
  VideoUse use_;
  std::unique_ptr<VideoEncoder> encoder_;  // goes before its file
  int frames_ = 0;
  bool failed_ = false;
};

}  // namespace lapservo::internal
