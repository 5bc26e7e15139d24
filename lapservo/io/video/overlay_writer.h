#pragma once

#include <filesystem>
#include <memory>

#include <opencv2/core.hpp>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// Where `--overlay PATH` goes: an image for an image (when PATH ends like one), a folder of images for images, a
/// video for videos and cameras. Images appear whole, one by one; a video when committed.
class OverlayWriter {
 public:
  virtual ~OverlayWriter() = default;
  virtual void add(const Frame& frame, const cv::Mat& overlay) = 0;
  virtual void commit() = 0;
  virtual bool is_video() const { return false; }
};

/// Throws InputError at once when PATH can't be written.
std::unique_ptr<OverlayWriter> open_overlay_writer(const std::filesystem::path& path, const FrameSource& source);

}  // namespace lapservo::internal
