#include "lapservo/io/video/video_writer.h"

#include <string>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

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

VideoWriter::VideoWriter(const fs::path& path, double frames_per_second, VideoUse use)
    : target_(path), frames_per_second_(frames_per_second), use_(use) {
  if (target_.is_stream())
    throw InputError(path.string(), "is no regular file, expected a video to write, like overlay.mp4");
  temporary_.emplace(target_);
}

void VideoWriter::add(const cv::Mat& frame, std::optional<double> time_s) {
  const std::string name = target_.name.string();
  if (!encoder_)
    encoder_ = std::make_unique<VideoEncoder>(temporary_->path(), name, frame.size(), frames_per_second_, use_);
  if (frame.type() != CV_8UC3 || frame.size() != encoder_->size())
    throw InputError(name, "can't take a frame of another size or kind than the first");
  ++frames_;
  if (failed_) return;
  try {
    encoder_->add(frame, time_s);
  } catch (const InputError&) {  // commit() reports it, after the writers of other results have finished
    failed_ = true;
  }
}

void VideoWriter::commit() {
  if (!encoder_) return;
  if (!failed_) encoder_->finish();
  encoder_.reset();
  if (failed_ || frames_in(temporary_->path()) != frames_)
    throw InputError(target_.name.string(), "could not be written to its end (is the disk full?)");
  temporary_->commit();
}

}  // namespace lapservo::internal
