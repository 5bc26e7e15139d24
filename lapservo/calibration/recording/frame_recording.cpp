#include "lapservo/calibration/recording/frame_recording.h"

#include <algorithm>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "lapservo/io/image_file.h"
#include "lapservo/vision/image/interlacing.h"

namespace lapservo::internal {
namespace {

std::string name_of(const Frame& frame, const std::string& recording) {
  return frame.file.empty() ? recording : frame.file.string();
}

}  // namespace

std::string text_of_damaged(int damaged, int frames) {
  return fmt::format("{} of {} frames are damaged: repair what carries them, or record them again", damaged, frames);
}

std::string FramesRead::remark_on_damaged() const {
  return damaged > 0 ? fmt::format(" ({} are damaged)", damaged) : "";
}

void expect_srgb(bool is_srgb, const std::string& recording, const Response& response) {
  if (!is_srgb || response.kind == Response::Kind::srgb || response.sigma) return;
  throw InputError(recording,
                   "names how it encodes light, which is read as sRGB, but the rig's response is another, "
                   "expected srgb, or one that calibrate camera measured with such images");
}

void check_frame_size(const Frame& frame, const std::string& recording, const cv::Size& expected,
                      const std::string& whose) {
  if (frame.bgr.size() != expected)
    throw InputError(name_of(frame, recording), "size", fmt::format("{} x {}", frame.bgr.cols, frame.bgr.rows),
                     fmt::format("{} x {}, as {} has it", expected.width, expected.height, whose));
}

void check_frame_reading(const Frame& frame, const std::string& recording, const Response& response, bool deinterlace) {
  const std::string name = name_of(frame, recording);
  expect_srgb(frame.is_srgb, name, response);
  if (frame.deinterlaced.value_or(deinterlace) == deinterlace) return;
  throw InputError(name, "deinterlaced", fmt::format("{}", !deinterlace),
                   deinterlace ? "true, as one field of each frame is tracked: open the video with deinterlaced=True"
                               : "false, as whole frames are tracked: open the video without deinterlaced, or track "
                                 "with deinterlace: true in the rig");
}

FramesRead read_frames(const FrameRecording& recording, const Rig& rig, int every, const JobWatch& watch,
                       const std::function<std::string(const cv::Mat&, double)>& look) {
  FrameSource& source = recording.source;
  const bool deinterlace = recording.deinterlace || rig.camera.deinterlace;
  EvenField field(rig.camera.response);
  FramesRead frames;
  int read = 0;
  while (!(frames.stopped = watch.stopped())) {
    const auto frame = source.next();
    if (!frame) break;
    check_frame_size(*frame, recording.name, {rig.camera.width_px, rig.camera.height_px}, "the rig's camera");
    check_frame_reading(*frame, recording.name, rig.camera.response, deinterlace);
    if (read++ % every != 0) continue;
    if (frame->flaw) {
      ++frames.damaged;
      continue;
    }
    ++frames.looked_at;
    frames.jpegs += has_jpeg_extension(frame->file) ? 1 : 0;
    watch.tell(source.frame_count(), read,
               look(deinterlace ? field.of(frame->bgr).clone() : frame->bgr, frame->time_s));
  }
  if (source.kind() == FrameSource::Kind::live) frames.stopped = false;  // that is how a camera's recording ends
  if (!frames.stopped && frames.all_damaged())
    throw InputError(recording.name, text_of_damaged(frames.damaged, frames.damaged));
  frames.lossy = source.is_lossy() || frames.jpegs > 0;
  if (!frames.stopped) frames.complaint = source.complaint();
  return frames;
}

int every_of(const FrameSource& source, int enough) {
  return std::max(1, source.frame_count().value_or(0) / enough);
}

}  // namespace lapservo::internal
