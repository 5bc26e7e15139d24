#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "lapservo/io/video/libav.h"

namespace lapservo::internal {

/// A remark on videos when this FFmpeg has no libx264: that they are MPEG-4 part 2; else empty.
std::string video_remark();

enum class VideoUse {
  shown,     ///< 4:2:0, which browsers play; 4:4:4 where the width or height is odd
  measured,  ///< 4:4:4 at a finer quality, several times the size: colour boundaries stay where they are
};

/// A video file while it is written, by FFmpeg's libraries: H.264 (libx264) in Rec. 601's limited range, with 4:2:0
/// chroma's samples amid four pixels, which the file says, as VideoReader reads it back. Without libx264 it is MPEG-4
/// part 2.
class VideoEncoder {
 public:
  /// The container goes by the ending of `shown`. Throws InputError naming it when there is none for it.
  VideoEncoder(const std::filesystem::path& path, const std::string& shown, const cv::Size& size,
               double frames_per_second, VideoUse use);

  cv::Size size() const { return {codec_->width, codec_->height}; }
  /// 8-bit BGR of that size, shown `time_s` seconds after the video's start; without a time, or with one that is not
  /// later than the frame before, a period after that. Containers of constant rate (.avi) round the times to periods.
  /// Throws InputError when it can't be written.
  void add(const cv::Mat& bgr, std::optional<double> time_s = std::nullopt);
  /// Writes what is left, and the container's index.
  void finish();

 private:
  struct FreedFile {
    void operator()(AVFormatContext* file) const;
  };

  bool constant_rate() const;
  void open_codec(const cv::Size& size, double frames_per_second, VideoUse use);
  void open_file(const std::filesystem::path& path);
  void convert(const cv::Mat& bgr);
  void write_packets();
  [[noreturn]] void refuse() const;
  void need(int result) const;

  std::string shown_;
  std::unique_ptr<AVFormatContext, FreedFile> file_;
  libav::Codec codec_;
  libav::Scaler scaler_;
  libav::Frame frame_{av_frame_alloc()};
  libav::Packet packet_{av_packet_alloc()};
  std::int64_t period_ = 1;  ///< between frames, in units of the encoder's time base
  std::int64_t last_ = -1;   ///< the latest frame's time, in the same units
};

}  // namespace lapservo::internal
