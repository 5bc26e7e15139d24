#include "apps/lapservo/calibrate_inputs.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/frame_input.h"
#include "apps/lapservo/input_files.h"
#include "apps/lapservo/interrupt.h"
#include "apps/lapservo/progress.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/instrument_index.h"
#include "lapservo/vision/interlacing.h"

namespace lapservo::app {
using namespace internal;
namespace fs = std::filesystem;

void add_calibrate_options(Command command, CalibrateOptions& options) {
  command.add_option("--rig", options.rig, "The rig as it is known so far").required();
  command.add_option("--out", options.out, "The rig to write or replace, with what was measured; may be --rig's")
      .required();
  add_recording_options(command, options);
}

void add_recording_options(Command command, CalibrateOptions& options) {
  command.add_option("--instrument", options.instrument, "Its name, where the rig has several");
  command.add_flag("--deinterlace", options.deinterlace, "For interlaced video: measure the field of the even rows");
  add_image_topic_option(command, options.image_topic);
  command.add_option("--fps", options.fps, "Frames per second of a folder of pictures")
      .shows_default()
      .number_between(0.001, 1000.0);
}

std::size_t named_instrument(const Rig& rig, const std::string& name, const std::string& rig_file) {
  if (name.empty()) {
    if (rig.instruments.size() > 1) throw InputError(rig_file, "has several instruments: name one with --instrument");
    return 0;
  }
  const auto index = instrument_index(rig, name);
  if (!index) throw InputError("--instrument", "name", name, "an instrument of " + rig_file);
  return *index;
}

void refuse_outputs_over_inputs(const CalibrateOptions& options, const Rig& rig) {
  InputFiles inputs;
  inputs.add(options.input), inputs.add(options.joints);
  std::error_code error;
  for (const std::string& input : {options.input, options.joints})
    if (fs::is_directory(input, error)) inputs.add_pictures_in(input);
  for (const std::string& out : {options.out, options.report}) inputs.refuse_as_output(out);
  if (!options.report.empty() &&
      fs::weakly_canonical(options.out, error) == fs::weakly_canonical(options.report, error))
    throw InputError(options.out, "is the place for --out and --report, expected two places");
  inputs.add_rig(options.rig, rig);
  inputs.refuse_as_output(options.report);
}

void check_size(const Frame& frame, const std::string& input, const cv::Size& expected, const std::string& whose) {
  if (frame.bgr.size() != expected)
    throw InputError(frame.file.empty() ? input : frame.file.string(), "size",
                     fmt::format("{} x {}", frame.bgr.cols, frame.bgr.rows),
                     fmt::format("{} x {}, as {} has it", expected.width, expected.height, whose));
}

void say_complaint(const std::string& input, const FrameSource& source) {
  if (const std::string complaint = source.complaint(); !complaint.empty())
    std::fprintf(stderr, "lapservo: %s: %s: what could be read is used\n", input.c_str(), complaint.c_str());
}

FramesRead read_frames(const CalibrateOptions& options, const Rig& rig, FrameSource& source, int every,
                       const std::function<std::string(const cv::Mat&, double)>& look) {
  const bool deinterlace = options.deinterlace || rig.camera.deinterlace;
  EvenField field(rig.camera.response);
  FramesRead frames;
  Progress progress(source.frame_count());
  int read = 0;
  while (!(frames.stopped = interrupted())) {
    const auto frame = source.next();
    if (!frame) break;
    check_size(*frame, options.input, {rig.camera.width_px, rig.camera.height_px}, "the rig's camera");
    if (read++ % every != 0) continue;
    if (frame->flaw) {
      ++frames.flawed;
      continue;
    }
    ++frames.looked_at;
    progress.show(read, look(deinterlace ? field.of(frame->bgr) : frame->bgr, frame->time_s));
  }
  return frames;
}

int refuse_calibration(const CalibrateOptions& options, const std::string& why) {
  std::fprintf(stderr, "lapservo: %s: %s; the rig is as it was\n", options.input.c_str(), why.c_str());
  return 1;
}

}  // namespace lapservo::app
