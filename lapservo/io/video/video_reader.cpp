#include "lapservo/io/video/video_reader.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <utility>
#include <vector>

extern "C" {
#include <libavutil/display.h>
#include <libavutil/opt.h>
#include <libavutil/pixdesc.h>
}

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/core/error.h"
#include "lapservo/io/pictures/jpeg_picture.h"
#include "lapservo/io/pictures/picture_parts.h"
#include "lapservo/io/video/bgr_converter.h"
#include "lapservo/io/video/libav.h"
#include "lapservo/io/video/yuv_colours.h"

namespace lapservo::internal {
namespace {
using Clock = std::chrono::steady_clock;

int past(void* deadline) {
  return Clock::now() > *static_cast<Clock::time_point*>(deadline) ? 1 : 0;
}

// Whether it begins with a box of MP4 or QuickTime, and lacks the one that says where its frames are.
bool lacks_index(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<std::uint8_t, 16> head{};
  bool is_mp4 = false;
  for (std::uint64_t at = 0;
       file.seekg(static_cast<std::streamoff>(at)) && file.read(reinterpret_cast<char*>(head.data()), 16);) {
    const Numbers numbers{head, true};
    const std::string_view name(reinterpret_cast<const char*>(&head[4]), 4);
    if (name == "moov") return false;
    is_mp4 = is_mp4 || name == "ftyp" || name == "mdat";
    const std::uint64_t size = numbers.of(0, 4) == 1 ? numbers.of(8, 8) : numbers.of(0, 4);
    if (size < 8 || !is_mp4) break;
    at += size;
  }
  return is_mp4;
}

bool turned(const AVStream& stream) {
  const std::uint8_t* matrix = av_stream_get_side_data(&stream, AV_PKT_DATA_DISPLAYMATRIX, nullptr);
  return matrix && std::abs(av_display_rotation_get(reinterpret_cast<const std::int32_t*>(matrix))) > 1;
}

class Video : public FrameSource {
 public:
  Video(const std::string& name, Kind kind, const VideoReading& reading, std::chrono::milliseconds patience)
      : source_(name),
        kind_(kind),
        patience_(patience),
        fields_(reading.deinterlaced),
        given_(given_colours(reading.colour_matrix, reading.chroma_location)) {
    av_log_set_level(AV_LOG_QUIET);
    open();
    stream_ = format_->streams[choose_stream()];
    if (turned(*stream_))
      throw InputError(source_,
                       "is to be turned for display, expected the camera's pixels upright: ffmpeg -i IN -c copy "
                       "-metadata:s:v:0 rotate=0 OUT.mp4 keeps them");
    open_decoder();
    first_ = read();
    if (!first_)
      throw InputError(source_, is_stream() ? "gives no frames, expected a stream" : "has no frames, expected a video");
  }

  std::optional<Frame> next() override { return first_ ? std::exchange(first_, std::nullopt) : read(); }
  Kind kind() const override { return kind_; }

  // Where the container doesn't hold the count: from its duration, unless that is a guess from the last packet.
  std::optional<int> frame_count() const override {
    if (is_stream()) return std::nullopt;
    if (stream_->nb_frames > 0) return static_cast<int>(std::min<std::int64_t>(stream_->nb_frames, 1'000'000'000));
    if (format_->duration_estimation_method != AVFMT_DURATION_FROM_STREAM || format_->duration <= 0)
      return std::nullopt;
    const double count = static_cast<double>(format_->duration) / AV_TIME_BASE * frames_per_second();
    return count > 0 && count < 1e9 ? std::optional(static_cast<int>(std::lround(count))) : std::nullopt;
  }

  double frames_per_second() const override {
    const double fps = av_q2d(av_guess_frame_rate(format_.get(), stream_, nullptr));
    return fps > 0 && fps < 10000 ? fps : 30;
  }

  std::string remark() const override { return remark_; }
  bool is_srgb() const override { return is_srgb_; }
  bool is_lossy() const override {
    const AVCodecDescriptor* codec = avcodec_descriptor_get(stream_->codecpar->codec_id);
    return codec && (codec->props & AV_CODEC_PROP_LOSSY) != 0;
  }

  std::string complaint() const override {
    if (is_stream())
      return broke_off_ ? fmt::format("broke off, or was silent for {} s, after {:.2f} s",
                                      std::chrono::duration<double>(patience_).count(), end_s_)
                        : "";
    constexpr double slack = 0.01;  // durations are rounded
    const double frames_s = 2 / frames_per_second(), read_s = std::max(end_s_, end_of_all_s_);
    if (const auto announced_s = duration_s(); announced_s && read_s < (1 - slack) * *announced_s - frames_s)
      return fmt::format("ends early, after {:.2f} of {:.2f} s", end_s_, *announced_s);
    if (format_->pb && avio_size(format_->pb) % transport_packet_bytes() != 0) return "ends within a frame";
    return damaged_ > 0 ? "is damaged in " + std::to_string(damaged_) + " of " + std::to_string(frames_) + " frames"
                        : "";
  }

 private:
  bool is_stream() const { return kind_ == Kind::live; }

  std::optional<Frame> read() {
    while (true) {
      const int got = avcodec_receive_frame(decoder_.get(), frame_.get());
      if (got == 0) return delivered();
      if (got == AVERROR_EOF) return std::nullopt;
      if (got != AVERROR(EAGAIN)) return lost();
      if (!feed()) return lost();
    }
  }

  // By the distance of their sync bytes, as FFmpeg found it: 188, 192 in a camcorder's .mts, 204 with error correction.
  // 1 for other containers.
  std::int64_t transport_packet_bytes() const {
    std::int64_t bytes = 1;
    if (std::string_view(format_->iformat->name) == "mpegts")
      av_opt_get_int(format_->priv_data, "ts_packetsize", 0, &bytes);
    return std::max<std::int64_t>(1, bytes);
  }

  void open() {
    deadline_ = Clock::now() + patience_;
    AVFormatContext* format = avformat_alloc_context();
    format->interrupt_callback = {past, &deadline_};
    AVDictionary* options = nullptr;
    if (is_stream()) av_dict_set(&options, "rtsp_transport", "tcp", 0);  // which loses nothing
    const bool opened = avformat_open_input(&format, url().c_str(), nullptr, &options) == 0;
    av_dict_free(&options);
    format_.reset(opened ? format : nullptr);
    if (!opened && !is_stream() && lacks_index(source_))
      throw InputError(source_,
                       "has no index (moov), as of a recorder that was switched off: untrunc GOOD.mp4 FILE repairs it "
                       "by a whole video of the same recorder");
    if (!opened || avformat_find_stream_info(format, nullptr) < 0)
      throw InputError(source_, is_stream() ? "can't be opened, expected a camera or stream"
                                            : "can't be read, expected an image or a video");
    deadline_ = Clock::time_point::max();  // the file keeps asking; whoever measures slowly is not late
  }

  std::string url() const { return is_stream() ? source_ : libav::url_of(source_); }

  // The first, whatever the others' sizes and bit rates are: recorders of two eyes may write a track for each.
  std::size_t choose_stream() {
    std::optional<std::size_t> first;
    for (unsigned i = 0; i < format_->nb_streams; ++i) {
      const AVStream& stream = *format_->streams[i];
      const bool is_cover = (stream.disposition & AV_DISPOSITION_ATTACHED_PIC) != 0;
      if (stream.codecpar->codec_type != AVMEDIA_TYPE_VIDEO || is_cover) continue;
      if (!first) first = i;
      ++tracks_;
    }
    if (!first) throw InputError(source_, "has no frames, expected a video");
    return *first;
  }

  void open_decoder() {
    const AVCodec* codec = avcodec_find_decoder(stream_->codecpar->codec_id);
    decoder_.reset(codec ? avcodec_alloc_context3(codec) : nullptr);
    if (!decoder_ || avcodec_parameters_to_context(decoder_.get(), stream_->codecpar) < 0)
      throw InputError(source_, "can't be decoded, expected a video");
    // With frames in parallel nobody knows whose error it is; with slices FFmpeg's decoders of H.264 and H.265 forget
    // what they complained of, that of MPEG-2 does not.
    decoder_->thread_count = codec->id == AV_CODEC_ID_MPEG2VIDEO ? 0 : 1;
    decoder_->thread_type = FF_THREAD_SLICE;
    decoder_->err_recognition = AV_EF_CRCCHECK | AV_EF_BITSTREAM | AV_EF_BUFFER | AV_EF_EXPLODE;
    decoder_->framerate = {0, 1};  // what the frames say, not the demuxer
    if (codec->id == AV_CODEC_ID_H264) decoder_->err_recognition |= AV_EF_AGGRESSIVE;
    if (avcodec_open2(decoder_.get(), codec, nullptr) < 0)
      throw InputError(source_, "can't be decoded, expected a video");
  }

  // Gives the decoder its next packet; false when it complains of it.
  bool feed() {
    if (is_stream()) deadline_ = Clock::now() + patience_;
    int read = 0;
    while ((read = av_read_frame(format_.get(), packet_.get())) >= 0) {
      const bool ours = packet_->stream_index == stream_->index;
      look_at_end(*packet_);
      if (ours) packet_stamp_ = (packet_->flags & AV_PKT_FLAG_DISCARD) != 0 ? AV_NOPTS_VALUE : packet_->pts;
      if (ours && packets_++ == 0) of_software_ = names_software();
      if (ours && (packet_->flags & AV_PKT_FLAG_CORRUPT) != 0) tainted_ = true;
      if (ours && stream_->codecpar->codec_id == AV_CODEC_ID_MJPEG) check_jpeg_packet();
      const int sent = ours ? avcodec_send_packet(decoder_.get(), packet_.get()) : 0;
      av_packet_unref(packet_.get());
      if (ours) return sent >= 0 || sent == AVERROR(EAGAIN);
    }
    broke_off_ = is_stream() && read != AVERROR_EOF;
    return avcodec_send_packet(decoder_.get(), nullptr) >= 0;
  }

  // Without a count of frames the duration may be that of sound or subtitles, or include a time before the video
  // begins.
  void look_at_end(const AVPacket& packet) {
    if (stream_->nb_frames > 0 || packet.pts == AV_NOPTS_VALUE) return;
    // A stream's own duration counts from its beginning, that of a file from 0.
    const bool of_stream = stream_->duration > 0 && format_->start_time != AV_NOPTS_VALUE;
    const double begin_s = of_stream ? static_cast<double>(format_->start_time) / AV_TIME_BASE : 0;
    const double unit_s = av_q2d(format_->streams[packet.stream_index]->time_base);
    end_of_all_s_ = std::max(end_of_all_s_, static_cast<double>(packet.pts + packet.duration) * unit_s - begin_s);
  }

  // By the first packet, what precedes it or the container.
  bool names_software() const {
    if (is_codec_of_recorders(stream_->codecpar->codec_id)) return false;
    const auto names = [](const std::uint8_t* data, int size) {
      constexpr int most = 4096;
      return data && size > 0 && names_software_encoder({data, static_cast<std::size_t>(std::min(most, size))});
    };
    const AVDictionaryEntry* const encoder = av_dict_get(stream_->metadata, "encoder", nullptr, 0);
    return names(packet_->data, packet_->size) ||
           names(stream_->codecpar->extradata, stream_->codecpar->extradata_size) ||
           (encoder && std::string_view(encoder->value).starts_with("Lavc"));
  }

  // FFmpeg's decoder of motion JPEG says nothing where the data go on after the last row: rows are shifted then. Bytes
  // before a restart marker shift them, too.
  void check_jpeg_packet() {
    const auto [complaint, clean] = check_jpeg({packet_->data, static_cast<std::size_t>(std::max(0, packet_->size))});
    tainted_ = tainted_ || !complaint.empty();
    const int size = static_cast<int>(clean.size()), more = size - packet_->size;
    if (clean.empty() || av_packet_make_writable(packet_.get()) < 0) return;
    if (more > 0 && av_grow_packet(packet_.get(), more) < 0) return;
    std::copy(clean.begin(), clean.end(), packet_->data);
    av_shrink_packet(packet_.get(), size);
  }

  // Frames predicted from a damaged one are damaged too, up to the next that stands alone.
  Frame delivered() {
    const bool flawed = (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0 || frame_->decode_error_flags != 0;
    const bool packet_flawed = std::exchange(tainted_, false);
    spoiled_ = flawed || packet_flawed || (spoiled_ && frame_->key_frame == 0);
    convert();
    advance(frame_->best_effort_timestamp, libav::duration_of(*frame_));
    av_frame_unref(frame_.get());
    return counted(spoiled_, last_);
  }
  Frame lost() {
    spoiled_ = true;
    if (last_.empty())
      last_ = cv::Mat::zeros(std::max(1, stream_->codecpar->height), std::max(1, stream_->codecpar->width), CV_8UC3);
    advance(stamped_ ? AV_NOPTS_VALUE : packet_stamp_, 0);  // its packet may be a later frame's once frames have come
    return counted(true, last_.clone());
  }
  Frame counted(bool damaged, const cv::Mat& bgr) {
    damaged_ += damaged ? 1 : 0;
    const auto flaw = damaged ? std::optional(Status::damaged) : std::nullopt;
    return {bgr, frames_++, time_s_.value_or(0), {}, flaw, fields_, is_srgb_};
  }

  // The first stamp is where times begin, be its frame lost. Frames that the container gives no time, or none later
  // than the frame before, follow at the stream's rate.
  void advance(std::int64_t stamp, std::int64_t duration) {
    const double unit_s = av_q2d(stream_->time_base), period_s = 1 / frames_per_second();
    const double by_rate_s = time_s_ ? *time_s_ + period_s : 0;
    const double at_s = stamp == AV_NOPTS_VALUE ? by_rate_s : static_cast<double>(stamp) * unit_s - first_s_;
    if (stamp != AV_NOPTS_VALUE && !std::exchange(stamped_, true)) {
      first_s_ = at_s - by_rate_s;
      time_s_ = by_rate_s;
    } else {
      time_s_ = time_s_ && !(at_s > *time_s_) ? by_rate_s : at_s;
    }
    end_s_ = *time_s_ + std::max(period_s, static_cast<double>(duration) * unit_s);
  }

  // As the container announces it, of the video alone where it knows that.
  std::optional<double> duration_s() const {
    if (stream_->duration > 0) return static_cast<double>(stream_->duration) * av_q2d(stream_->time_base);
    if (format_->duration_estimation_method == AVFMT_DURATION_FROM_STREAM && format_->duration > 0)
      return static_cast<double>(format_->duration) / AV_TIME_BASE;
    return std::nullopt;
  }

  void note_remarks(const YuvColours& colours) {
    is_srgb_ = colours.transfer.has_value();
    std::vector<std::string> remarks;
    if (colours.transfer) remarks.push_back(remark_on_transfer(*colours.transfer));
    if (!given_.matrix) remarks.push_back(remark_on_matrix(*frame_, of_software_));
    remarks.push_back(remark_on_given(*frame_, given_));
    if (has_assumed_rate())
      remarks.push_back(
          fmt::format("names no times and no rate: read as {:.6g} frames/s (ffmpeg -framerate RATE -i IN -c copy "
                      "OUT.mp4 writes them)",
                      frames_per_second()));
    if (tracks_ > 1)
      remarks.push_back(fmt::format(
          "has {} video tracks, of which the first is read (ffmpeg -i IN -map 0:v:1 -c copy OUT takes out another)",
          tracks_));
    std::erase(remarks, "");
    remark_ = fmt::format("{}", fmt::join(remarks, "; "));
  }

  // Data without a container, whose frames do not say it either.
  bool has_assumed_rate() const {
    const AVInputFormat& container = *format_->iformat;
    const bool has_times =
        (container.flags & AVFMT_NOTIMESTAMPS) == 0 && !std::string_view(container.name).ends_with("_pipe");
    return !is_stream() && !has_times && decoder_->framerate.num <= 0;
  }

  // By each frame's own tags: a stream's may change.
  void convert() {
    if (const std::string coarse = coarse_pixels(*frame_, stream_->codecpar->codec_id); !coarse.empty())
      throw InputError(source_, coarse);
    const auto colours = yuv_colours_of(*frame_, stream_->codecpar->codec_id, of_software_, given_);
    if (!colours)
      throw InputError(source_, "colour matrix", av_color_space_name(frame_->colorspace),
                       "bt709, smpte170m, bt470bg, bt2020nc, fcc or smpte240m (convert it: ffmpeg -i IN -vf "
                       "scale=out_color_matrix=bt709 -colorspace bt709 OUT)");
    if (const std::string expected = expected_transfer(*frame_); !expected.empty())
      throw InputError(source_, "transfer", av_color_transfer_name(frame_->color_trc), expected);
    last_.release();  // whoever was given it has it
    if (!converter_.convert(*frame_, *colours, fields_, last_))
      throw InputError(source_, "has pixels of a kind that can't be converted, expected a video");
    if (frames_ == 0) note_remarks(*colours);
  }

  std::string source_;
  Kind kind_;
  std::chrono::milliseconds patience_;
  Clock::time_point deadline_;
  std::unique_ptr<AVFormatContext, libav::Freed<avformat_close_input>> format_;
  libav::Codec decoder_;
  libav::Packet packet_{av_packet_alloc()};
  libav::Frame frame_{av_frame_alloc()};
  bool fields_;
  GivenColours given_;
  std::string remark_;
  bool is_srgb_ = false, broke_off_ = false;
  bool of_software_ = false;  // a software encoder wrote the stream
  BgrConverter converter_;
  AVStream* stream_ = nullptr;
  cv::Mat last_;
  std::optional<Frame> first_;    // until it is given
  std::optional<double> time_s_;  // of the last frame, since the first
  double end_s_ = 0;              // of the last frame
  double end_of_all_s_ = 0;       // of all streams, where they have one duration
  double first_s_ = 0;            // the first frame's stamp
  bool stamped_ = false;          // a frame had a stamp
  std::int64_t packet_stamp_ = AV_NOPTS_VALUE;
  int packets_ = 0, frames_ = 0, damaged_ = 0;
  int tracks_ = 0;        // of video
  bool tainted_ = false;  // a packet since the last frame was damaged on its way
  bool spoiled_ = false;  // the last frame is damaged
};

}  // namespace

std::unique_ptr<FrameSource> open_video(const std::string& name, FrameSource::Kind kind, const VideoReading& reading,
                                        std::chrono::milliseconds patience) {
  return std::make_unique<Video>(name, kind, reading, patience);
}

}  // namespace lapservo::internal
