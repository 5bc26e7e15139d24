#pragma once

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "lapservo/io/frame_source.h"

namespace lapservo::internal {

/// The frames of a video file, by FFmpeg's libraries: OpenCV hides what their decoders complain of.
class VideoReader {
 public:
  struct Image {
    cv::Mat bgr;           ///< 8-bit; of a frame that can't be decoded at all, the one before (or black)
    bool damaged = false;  ///< the decoder complained of it, or of one that it was predicted from
    double time_s = 0;     ///< since the first frame, by the container's time stamps; where it has none, by the rate
  };

  /// A stream (rtsp://...) is waited for as long when it falls silent, and has ended then.
  enum class Kind { file, stream };

  /// Throws InputError when it holds no video that can be decoded, or one with an orientation for display: a
  /// calibration belongs to the pixels in one orientation, and it is unknown which.
  /// `patience` bounds the time of opening, not that of reading.
  explicit VideoReader(const std::filesystem::path& path, std::chrono::milliseconds patience = std::chrono::seconds(5),
                       Kind kind = Kind::file, const VideoReading& reading = {});
  ~VideoReader();

  /// nullopt at the end.
  std::optional<Image> next();
  /// As the file announces it; nullopt when it doesn't.
  std::optional<int> frame_count() const;
  double frames_per_second() const;
  /// After the first frame: FrameSource::remark().
  std::string remark() const;
  /// After the first frame: FrameSource::is_srgb().
  bool is_srgb() const;
  bool is_lossy() const;  ///< FrameSource::is_lossy()
  /// After the end: that the frames end before the duration that the container announces or within a frame, else empty.
  std::string complaint() const;

 private:
  class State;
  std::unique_ptr<State> state_;
};

}  // namespace lapservo::internal
