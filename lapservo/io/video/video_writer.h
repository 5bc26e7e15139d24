#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include <opencv2/core.hpp>

#include "lapservo/core/output_target.h"
#include "lapservo/io/video/libav.h"

namespace lapservo::internal {

/// A remark on videos when this FFmpeg has no libx264: that they are MPEG-4 part 2; else empty.
std::string video_remark();

enum class VideoUse {
  shown,     ///< 4:2:0, which browsers play; 4:4:4 where the width or height is odd
  measured,  ///< 4:4:4 at a finer quality, several times the size: colour boundaries stay where they are
};

/// A video that appears whole or not at all, by FFmpeg's libraries: H.264 (libx264) in Rec. 601's limited range, with
/// 4:2:0 chroma's samples amid four pixels, which the file says, as open_video() reads it back. Without libx264 it is
/// MPEG-4 part 2. Its container goes by the name's ending (.mp4, .avi, .mkv). It must be a regular file, as an index is
/// written in the end. See OutputTarget.
class VideoWriter {
 public:
  /// Throws InputError at once when it can't be written.
  VideoWriter(const std::filesystem::path& path, double frames_per_second, VideoUse use = VideoUse::shown);

  /// 8-bit BGR, all of one size, shown `time_s` seconds after the video's start; without a time, or with one that is
  /// not later than the frame before, a period after that. Containers of constant rate (.avi) round the times to
  /// periods. Throws InputError when there is no encoder for the name's ending; commit() reports a full disk.
  void add(const cv::Mat& bgr, std::optional<double> time_s = std::nullopt);
  /// Throws InputError when the file does not hold every frame in the end. Without frames there is no video.
  void commit();

 private:
  struct FreedFile {
    void operator()(AVFormatContext* file) const;
  };

  std::string name() const { return target_.name.string(); }
  std::string url() const { return libav::url_of(temporary_->path()); }
  bool constant_rate() const;
  void open(const cv::Size& size);
  void open_codec(const cv::Size& size);
  void open_file();
  void encode(const cv::Mat& bgr, std::optional<double> time_s);
  void convert(const cv::Mat& bgr);
  void write_packets();
  void finish();
  [[noreturn]] void refuse() const;
  [[noreturn]] void fail() const;
  void need(int result) const;

  OutputTarget target_;
  std::optional<TemporaryFile> temporary_;
  double frames_per_second_;
  VideoUse use_;
  std::unique_ptr<AVFormatContext, FreedFile> file_;  // goes before the temporary file
  libav::Codec codec_;
  libav::Scaler scaler_;
  libav::Frame frame_{av_frame_alloc()};
  libav::Packet packet_{av_packet_alloc()};
  std::int64_t period_ = 1;  ///< between frames, in units of the encoder's time base
  std::int64_t last_ = -1;   ///< the latest frame's time, in the same units
  int frames_ = 0;
  bool failed_ = false;
};

}  // namespace lapservo::internal
