#include "lapservo/io/video/video_writer.h"

#include <algorithm>
#include <cmath>
#include <string_view>

extern "C" {
#include <libavutil/opt.h>
}

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

// Tried on rendered frames with a sensor's noise (docs/notes/decisions.md): as large, as near to the image and as
// fast to read as MPEG-4 part 2 was.
constexpr int ticks_per_second =
    60'000;  // whole periods of 24, 25, 30, 50 and 60 frames a second; MPEG-4's largest: 65535

constexpr const char *preset = "ultrafast", *crf_shown = "22", *crf_measured = "14";

// Not containers of several files, as playlists are. Those that list no codecs (MPEG-TS) take it, unless they are
// nothing but bytes.
bool takes(const AVOutputFormat* container, const AVCodec* codec) {
  if (!codec || (container->flags & AVFMT_NOFILE) != 0) return false;
  const int answer = avformat_query_codec(container, codec->id, FF_COMPLIANCE_NORMAL);
  return answer == 1 || (answer < 0 && (container->flags & AVFMT_NOTIMESTAMPS) == 0);
}

const AVCodec* encoder_for(const AVOutputFormat* container) {
  const AVCodec* const h264 = avcodec_find_encoder_by_name("libx264");
  const AVCodec* const mpeg4 = avcodec_find_encoder(AV_CODEC_ID_MPEG4);
  return takes(container, h264) ? h264 : takes(container, mpeg4) ? mpeg4 : nullptr;
}

void set_quality(AVCodecContext& codec, VideoUse use) {
  if (codec.codec_id == AV_CODEC_ID_H264) {
    av_opt_set(codec.priv_data, "preset", preset, 0);
    av_opt_set(codec.priv_data, "crf", use == VideoUse::measured ? crf_measured : crf_shown, 0);
  } else {
    constexpr int fine = 2;  // of 1 to 31
    codec.flags |= AV_CODEC_FLAG_QSCALE;
    codec.global_quality = FF_QP2LAMBDA * fine;
  }
}

// The values of sRGB by Rec. 601's matrix: swscale's default for BGR, in both directions. Chroma's samples lie amid
// four pixels, which is not a reader's default.
void set_colours(AVCodecContext& codec) {
  codec.color_range = AVCOL_RANGE_MPEG;
  codec.colorspace = AVCOL_SPC_SMPTE170M;
  codec.color_primaries = AVCOL_PRI_BT709;
  codec.color_trc = AVCOL_TRC_IEC61966_2_1;
  if (codec.pix_fmt == AV_PIX_FMT_YUV420P) codec.chroma_sample_location = AVCHROMA_LOC_CENTER;
}

// An index or a header may promise what a full disk did not take.
int frames_in(const fs::path& path) {
  AVFormatContext* opened = nullptr;
  if (avformat_open_input(&opened, libav::url_of(path).c_str(), nullptr, nullptr) < 0) return 0;
  const std::unique_ptr<AVFormatContext, libav::Freed<avformat_close_input>> file(opened);
  const libav::Packet packet(av_packet_alloc());
  int found = 0;
  while (av_read_frame(file.get(), packet.get()) >= 0) {
    found += (packet->flags & AV_PKT_FLAG_CORRUPT) == 0 ? 1 : 0;
    av_packet_unref(packet.get());
  }
  return found;
}

}  // namespace

std::string video_remark() {
  return avcodec_find_encoder_by_name("libx264")
             ? ""
             : "in MPEG-4 part 2, as FFmpeg here lacks libx264: browsers don't play it";
}

void VideoWriter::FreedFile::operator()(AVFormatContext* file) const {
  if (file->pb) avio_closep(&file->pb);
  avformat_free_context(file);
}

VideoWriter::VideoWriter(const fs::path& path, double frames_per_second, VideoUse use)
    : target_(path), frames_per_second_(frames_per_second), use_(use) {
  if (target_.is_stream())
    throw InputError(path.string(), "is no regular file, expected a video to write, like overlay.mp4");
  temporary_.emplace(target_);
}

void VideoWriter::add(const cv::Mat& bgr, std::optional<double> time_s) {
  if (bgr.type() != CV_8UC3 || (codec_ && bgr.size() != cv::Size(codec_->width, codec_->height)))
    throw InputError(name(), "can't take a frame of another size or kind than the first");
  if (!codec_) open(bgr.size());
  ++frames_;
  if (failed_) return;
  try {
    encode(bgr, time_s);
  } catch (const InputError&) {  // commit() reports it, after the writers of other results have finished
    failed_ = true;
  }
}

void VideoWriter::commit() {
  if (!codec_) return;
  if (!failed_) finish();
  codec_.reset();
  file_.reset();
  if (failed_ || frames_in(temporary_->path()) != frames_) fail();
  temporary_->commit();
}

void VideoWriter::open(const cv::Size& size) {
  av_log_set_level(AV_LOG_QUIET);
  AVFormatContext* file = nullptr;
  avformat_alloc_output_context2(&file, av_guess_format(nullptr, name().c_str(), nullptr), nullptr, url().c_str());
  if (!file) refuse();
  file_.reset(file);
  open_codec(size);
  open_file();
}

void VideoWriter::refuse() const {
  throw InputError(name(), "can't be written as a video, expected a name like overlay.mp4");
}

void VideoWriter::need(int result) const {
  if (result < 0 || (file_->pb && file_->pb->error < 0)) fail();
}

void VideoWriter::fail() const {
  throw InputError(name(), "could not be written to its end (is the disk full?)");
}

void VideoWriter::open_codec(const cv::Size& size) {
  constexpr int finest = 1'001'000;  // 30000/1001 is one of its fractions
  const AVCodec* encoder = encoder_for(file_->oformat);
  codec_.reset(encoder ? avcodec_alloc_context3(encoder) : nullptr);
  if (!codec_) refuse();
  const bool subsampled = use_ == VideoUse::shown && size.width % 2 == 0 && size.height % 2 == 0;
  codec_->width = size.width;
  codec_->height = size.height;
  codec_->pix_fmt = subsampled || encoder->id != AV_CODEC_ID_H264 ? AV_PIX_FMT_YUV420P : AV_PIX_FMT_YUV444P;
  codec_->framerate = av_d2q(frames_per_second_, finest);
  codec_->time_base = av_inv_q(codec_->framerate);
  if (!constant_rate()) {
    codec_->time_base = {1, ticks_per_second};
    period_ = std::max<std::int64_t>(1, std::llround(ticks_per_second / frames_per_second_));
  }
  codec_->gop_size = std::max(1, static_cast<int>(std::lround(frames_per_second_)));  // a second, to be stepped to
  codec_->max_b_frames = 0;  // so that times are in order in containers that know no other
  if (file_->oformat->flags & AVFMT_GLOBALHEADER) codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  set_quality(*codec_, use_);
  set_colours(*codec_);
  if (avcodec_open2(codec_.get(), encoder, nullptr) < 0) refuse();
}

void VideoWriter::open_file() {
  AVStream* stream = avformat_new_stream(file_.get(), nullptr);
  if (!stream || avcodec_parameters_from_context(stream->codecpar, codec_.get()) < 0) refuse();
  stream->time_base = codec_->time_base;
  stream->avg_frame_rate = codec_->framerate;
  need(avio_open(&file_->pb, url().c_str(), AVIO_FLAG_WRITE));
  AVDictionary* options = nullptr;
  av_dict_set(&options, "movflags", "+faststart", 0);  // the index first, for who plays it while it comes
  const int written = avformat_write_header(file_.get(), &options);
  av_dict_free(&options);
  if (written < 0 && file_->pb->error >= 0) refuse();
  need(written);
}

// Both rows and columns of chroma are means, not samples.
void VideoWriter::convert(const cv::Mat& bgr) {
  scaler_.reset(sws_getCachedContext(scaler_.release(), codec_->width, codec_->height, AV_PIX_FMT_BGR24, codec_->width,
                                     codec_->height, codec_->pix_fmt, SWS_BICUBIC | SWS_ACCURATE_RND, nullptr, nullptr,
                                     nullptr));
  frame_->width = codec_->width;
  frame_->height = codec_->height;
  frame_->format = codec_->pix_fmt;
  if (!frame_->buf[0]) need(av_frame_get_buffer(frame_.get(), 0));
  need(av_frame_make_writable(frame_.get()));
  const std::uint8_t* rows[4] = {bgr.data};
  const int steps[4] = {static_cast<int>(bgr.step)};
  if (!scaler_) refuse();
  sws_scale(scaler_.get(), rows, steps, 0, codec_->height, frame_->data, frame_->linesize);
}

// FFmpeg's flag for containers of variable rate (AVFMT_VARIABLE_FPS) is not set for mp4 and mov, which take it.
bool VideoWriter::constant_rate() const {
  return std::string_view(file_->oformat->name) == "avi";
}

void VideoWriter::encode(const cv::Mat& bgr, std::optional<double> time_s) {
  convert(bgr);
  const double unit_s = av_q2d(codec_->time_base);
  const std::int64_t at = time_s ? std::llround(*time_s / unit_s) : 0;
  last_ = at > last_ ? at : last_ + period_;
  frame_->pts = last_;
  need(avcodec_send_frame(codec_.get(), frame_.get()));
  write_packets();
}

void VideoWriter::write_packets() {
  AVStream* const stream = file_->streams[0];
  while (avcodec_receive_packet(codec_.get(), packet_.get()) == 0) {
    packet_->duration = period_;
    av_packet_rescale_ts(packet_.get(), codec_->time_base, stream->time_base);
    packet_->stream_index = stream->index;
    need(av_interleaved_write_frame(file_.get(), packet_.get()));
  }
}

void VideoWriter::finish() {
  need(avcodec_send_frame(codec_.get(), nullptr));
  write_packets();
  need(av_write_trailer(file_.get()));
  need(avio_closep(&file_->pb));
}

}  // namespace lapservo::internal
