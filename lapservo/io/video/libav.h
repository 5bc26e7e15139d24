#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libswscale/swscale.h>
}

/// FFmpeg's objects with owners.
namespace lapservo::internal::libav {

template <auto free>
struct Freed {
  template <typename Object>
  void operator()(Object* object) const {
    free(&object);
  }
};
struct FreedScaler {
  void operator()(SwsContext* scaler) const { sws_freeContext(scaler); }
};

using Codec = std::unique_ptr<AVCodecContext, Freed<avcodec_free_context>>;
using Frame = std::unique_ptr<AVFrame, Freed<av_frame_free>>;
using Packet = std::unique_ptr<AVPacket, Freed<av_packet_free>>;
using Scaler = std::unique_ptr<SwsContext, FreedScaler>;

/// How FFmpeg takes a file whose name has a colon.
inline std::string url_of(const std::filesystem::path& file) {
  return "file:" + file.string();
}

/// In the stream's time base; 0 where it is not known.
inline std::int64_t duration_of(const AVFrame& frame) {
#if LIBAVUTIL_VERSION_INT >= AV_VERSION_INT(57, 30, 100)
  return frame.duration;
#else
  return frame.pkt_duration;
#endif
}

}  // namespace lapservo::internal::libav
