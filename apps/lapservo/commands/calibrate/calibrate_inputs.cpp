#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <system_error>
#include <vector>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/progress.h"
#include "apps/lapservo/inputs/input_files.h"
#include "lapservo/core/error.h"
#include "lapservo/rig/calibration_record.h"
#include "lapservo/rig/instruments.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::app {
using namespace internal;

void add_board_options(Command command, BoardOptions& options, bool always) {
  const Rule width = between(0.1, 1000.0);
  command.add_option("--board", options.corners, always ? required() : Rule(),
                     "Inner corners of the board, COLUMNSxROWS, for example 9x6");
  command.add_option("--square-mm", options.square_mm, always ? required(width) : width, "Width of a square");
  command.add_option("--aruco", options.dictionary, "For a ChArUco board: its markers' dictionary, as DICT_4X4_50");
  command.add_option("--marker-mm", options.marker_mm, between(0.05, 1000.0),
                     "For a ChArUco board: a marker's width; else 3/4 of a square");
}

Board board_of(const BoardOptions& options) {
  BoardWords words{options.corners, 1e-3 * options.square_mm.value(), options.dictionary};
  if (options.marker_mm) words.marker_m = 1e-3 * *options.marker_mm;
  return internal::board_of(words);
}

void add_calibrate_options(Command command, CalibrateOptions& options) {
  command.add_option("--rig", options.rig, required(), "The rig as it is known so far");
  command.add_option("--out", options.out, required(),
                     "The rig to write or replace, with what was measured; may be --rig's");
  add_recording_options(command, options);
}

void add_recording_options(Command command, CalibrateOptions& options) {
  command.add_option("--instrument", options.instrument, "Its name, where the rig has several");
  command.add_flag("--deinterlace", options.deinterlace, "For interlaced video: measure the field of the even rows");
  add_image_topic_option(command, options.image_topic);
  add_video_options(command, options);
  command.add_option("--fps", options.fps, between(0.001, 1000.0), "Frames per second of a folder of images; else 30");
}

std::size_t instrument_meant(const Rig& rig, const std::string& name, const std::string& rig_file) {
  return named_instrument(rig, name.empty() ? std::nullopt : std::optional(name), rig_file, "--instrument");
}

void say_complaint(const std::string& input, const std::string& complaint) {
  if (!complaint.empty())
    std::fprintf(stderr, "lapservo: %s: %s: what could be read is used\n", input.c_str(), complaint.c_str());
}

void print_faults(const std::vector<std::string>& faults) {
  for (const std::string& fault : faults) std::printf("beyond the noise, counted in the sigmas: %s\n", fault.c_str());
}

JobWatch watched_job() {
  struct Stage {
    std::optional<Progress> progress;
    std::optional<int> total;
    int done = 0;
  };
  const auto stage = std::make_shared<Stage>();
  return {interrupted, [stage](std::optional<int> total, int done, const std::string& remark) {
            // Another one has begun: its time counts anew.
            if (!stage->progress || total != stage->total || done < stage->done) stage->progress.emplace(total);
            stage->total = total, stage->done = done;
            stage->progress->show(done, remark);
          }};
}

RigAsRead::RigAsRead(const std::string& rig) : rig_(rig), content_(content_state(rig)) {}

void RigAsRead::expect_unchanged(const std::string& out) const {
  std::error_code error;
  if (std::filesystem::equivalent(rig_, out, error) && content_state(rig_) != content_)
    throw InputError(out, "was changed while this ran, and is left as it is: repeat the command");
}

int refuse(const std::string& source, const std::string& why) {
  std::fprintf(stderr, "lapservo: %s: %s\n", source.c_str(), why.c_str());
  return 1;
}

InstrumentJob::InstrumentJob(const CalibrateOptions& given, bool with_frames)
    : options(given),
      read(options.rig),
      rig(load_rig(options.rig)),
      index(instrument_meant(rig, options.instrument, options.rig)) {
  InputFiles inputs;
  for (const std::string& input : {options.input, options.joints}) inputs.add_recording(input);
  for (const std::string& place : {options.out, options.report, options.dvrk.base_frame})
    inputs.refuse_as_output(place);
  refuse_shared_place({options.out, options.report, options.dvrk.base_frame});
  refuse_other_kind(options.out, ".yaml"), refuse_other_kind(options.report, ".html");
  refuse_other_kind(options.dvrk.base_frame, ".json");
  refuse_rig_over_part(options.out);
  inputs.add_rig(options.rig, rig);
  inputs.refuse_as_output(options.report), inputs.refuse_as_output(options.dvrk.base_frame);
  if (with_frames) frames = open_frames(options.input, options, &rig.camera);
}

void InstrumentJob::begin() {
  if (!options.out.empty()) out.emplace(options.out);
  if (!options.report.empty()) page.emplace(options.report);
  watch_for_interrupts();
}

int InstrumentJob::refuse(const std::string& why) const {
  return app::refuse(options.input, why + "; the rig is as it was");
}

void InstrumentJob::write_page(const Report& report) {
  if (!page) return;
  page->stream() << html_from(report);
  page->commit();
  std::printf("report: %s\n", options.report.c_str());
}

int InstrumentJob::write() {
  read.expect_unchanged(options.out);
  out.value().stream() << measured_rig_yaml(rig, options.out);
  out->commit();
  std::printf("rig: %s\n", options.out.c_str());
  return 0;
}

}  // namespace lapservo::app
