#include "lapservo/io/pictures/libav_picture.h"

#include <cstring>
#include <string>
#include <utility>

extern "C" {
#include <libavutil/pixdesc.h>
}

#include "lapservo/io/pictures/picture_parts.h"
#include "lapservo/io/video/bgr_converter.h"
#include "lapservo/io/video/libav.h"

namespace lapservo::internal {
namespace {

constexpr std::int64_t max_pixels = std::int64_t{16384} * 16384;

AVCodecID codec_of(PictureFormat format) {
  switch (format) {
    case PictureFormat::bmp:
      return AV_CODEC_ID_BMP;
    case PictureFormat::pnm:
      return AV_CODEC_ID_PPM;
    case PictureFormat::webp:
      return AV_CODEC_ID_WEBP;
    default:
      return AV_CODEC_ID_NONE;
  }
}

libav::Packet packet_of(std::span<const std::uint8_t> bytes) {
  libav::Packet packet(av_packet_alloc());
  if (!packet || av_new_packet(packet.get(), static_cast<int>(bytes.size())) < 0) return nullptr;
  std::memcpy(packet->data, bytes.data(), bytes.size());
  return packet;
}

// Where a decoder leaves out pixels without a word, what it left shows.
int filled_buffer(AVCodecContext* context, AVFrame* frame, int flags) {
  const int result = avcodec_default_get_buffer2(context, frame, flags);
  for (const AVBufferRef* buffer : frame->buf)
    if (result >= 0 && buffer)
      std::memset(buffer->data, *static_cast<const std::uint8_t*>(context->opaque), buffer->size);
  return result;
}

// Its pixels are fill at first, which has to outlive it.
libav::Codec open_decoder(AVCodecID id, std::uint8_t& fill) {
  const AVCodec* codec = avcodec_find_decoder(id);
  libav::Codec context(codec ? avcodec_alloc_context3(codec) : nullptr);
  if (!context) return nullptr;
  context->thread_count = 1;
  context->max_pixels = max_pixels;
  context->opaque = &fill;
  context->get_buffer2 = filled_buffer;
  context->err_recognition = AV_EF_CRCCHECK | AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_EXPLODE;
  return avcodec_open2(context.get(), codec, nullptr) == 0 ? std::move(context) : nullptr;
}

libav::Frame decoded_frame(AVCodecID id, std::span<const std::uint8_t> bytes, std::uint8_t fill) {
  av_log_set_level(AV_LOG_QUIET);
  const libav::Codec decoder = open_decoder(id, fill);
  const libav::Packet packet = packet_of(bytes);
  libav::Frame frame(av_frame_alloc());
  if (!decoder || !packet || !frame || avcodec_send_packet(decoder.get(), packet.get()) < 0) return nullptr;
  avcodec_send_packet(decoder.get(), nullptr);
  if (avcodec_receive_frame(decoder.get(), frame.get()) < 0) return nullptr;
  const bool flawed = (frame->flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame->decode_error_flags != 0;
  return flawed ? nullptr : std::move(frame);
}

// Grey or BGR of 8 or 16 bits.
struct Layout {
  AVPixelFormat format;
  int type;
};

Layout layout_of(AVPixelFormat format) {
  const AVPixFmtDescriptor& of = *av_pix_fmt_desc_get(format);
  const bool grey = of.nb_components <= 2 && (of.flags & AV_PIX_FMT_FLAG_PAL) == 0;
  const bool deep = of.comp[0].depth > 8;
  if (grey) return deep ? Layout{AV_PIX_FMT_GRAY16, CV_16UC1} : Layout{AV_PIX_FMT_GRAY8, CV_8UC1};
  return deep ? Layout{AV_PIX_FMT_BGR48, CV_16UC3} : Layout{AV_PIX_FMT_BGR24, CV_8UC3};
}

// JPEG's chroma location for lossy WebP; empty for all others.
cv::Mat pixels_of_yuv(const AVFrame& frame) {
  const AVPixFmtDescriptor& format = *av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
  cv::Mat bgr;
  const bool is_yuv = (format.flags & AV_PIX_FMT_FLAG_RGB) == 0 && format.nb_components >= 3;
  if (is_yuv) BgrConverter().convert(frame, {.chroma = ChromaSite::centre}, false, bgr);
  return bgr;
}

cv::Mat pixels_of(const libav::Frame& decoded) {
  if (!decoded) return {};
  const AVFrame& frame = *decoded;
  const auto format = static_cast<AVPixelFormat>(frame.format);
  const Layout layout = layout_of(format);
  if (const cv::Mat bgr = pixels_of_yuv(frame); !bgr.empty()) return bgr;
  const libav::Scaler scaler(sws_getContext(frame.width, frame.height, format, frame.width, frame.height, layout.format,
                                            SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP,
                                            nullptr, nullptr, nullptr));
  if (!scaler) return {};
  cv::Mat pixels(frame.height, frame.width, layout.type);
  std::uint8_t* rows[4] = {pixels.data};
  const int steps[4] = {static_cast<int>(pixels.step)};
  sws_scale(scaler.get(), frame.data, frame.linesize, 0, frame.height, rows, steps);
  return pixels;
}

}  // namespace

DecodedPicture libav_decode(std::span<const std::uint8_t> bytes) {
  const AVCodecID codec = codec_of(picture_format(bytes));
  if (codec == AV_CODEC_ID_NONE) return {};
  const libav::Frame frame = decoded_frame(codec, bytes, 0);
  if (std::string coarse = frame ? coarse_pixels(*frame, codec) : ""; !coarse.empty()) return {{}, "", coarse};
  const cv::Mat pixels = pixels_of(frame);
  const cv::Mat again = pixels_of(decoded_frame(codec, bytes, 255));
  const bool whole = !pixels.empty() && pixels.size() == again.size() && pixels.type() == again.type() &&
                     cv::norm(pixels, again, cv::NORM_INF) == 0;
  return {whole ? pixels : cv::Mat(), ""};
}

}  // namespace lapservo::internal
