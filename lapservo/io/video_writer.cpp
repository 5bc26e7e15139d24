#include "lapservo/io/video_writer.h"

#include <cmath>
#include <string>

#include <opencv2/videoio.hpp>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

// The last frame is asked for, as an index or a header may promise what a full disk did not take. Some containers
// (MPEG-TS) don't know how many frames they hold: these are counted.
bool holds_frames(const fs::path& path, int count) {
  cv::VideoCapture capture(path.string(), cv::CAP_FFMPEG);
  cv::Mat frame;
  if (!capture.isOpened()) return false;
  if (std::lround(capture.get(cv::CAP_PROP_FRAME_COUNT)) == count && capture.set(cv::CAP_PROP_POS_FRAMES, count - 1) &&
      capture.read(frame))
    return true;
  capture.open(path.string(), cv::CAP_FFMPEG);
  int found = 0;
  while (capture.grab()) ++found;
  return found == count;
}

}  // namespace

VideoWriter::VideoWriter(const fs::path& path, double frames_per_second)
    : target_(output_target(path)),
      frames_per_second_(frames_per_second),
      writer_(std::make_unique<cv::VideoWriter>()) {
  if (target_.is_stream)
    throw InputError(path.string(), "is no regular file, expected a video to write, like overlay.mp4");
  temporary_.emplace(target_, TemporaryFile::Name::always);
}

VideoWriter::~VideoWriter() {
  writer_->release();  // before its file goes
}

void VideoWriter::add(const cv::Mat& frame) {
  if (frames_ == 0)
    writer_->open(temporary_->path().string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('m', 'p', '4', 'v'),
                  frames_per_second_, frame.size());
  if (!writer_->isOpened())
    throw InputError(target_.name.string(), "can't be written as a video, expected a name like overlay.mp4");
  writer_->write(frame);
  ++frames_;
}

void VideoWriter::commit() {
  if (frames_ == 0) return;
  writer_->release();
  if (!holds_frames(temporary_->path(), frames_))
    throw InputError(target_.name.string(), "could not be written to its end (is the disk full?)");
  temporary_->commit();
}

}  // namespace lapservo::internal
