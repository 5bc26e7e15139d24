#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/calibration_report.h"
#include "apps/lapservo/input_files.h"
#include "apps/lapservo/interrupt.h"
#include "apps/lapservo/numbers.h"
#include "apps/lapservo/progress.h"
#include "apps/lapservo/subcommands.h"
#include "lapservo/calibration/marker_calibration.h"
#include "lapservo/calibration/seam_registration.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/rig/rig_updater.h"
#include "lapservo/vision/interlacing.h"

namespace lapservo::app {
using namespace internal;
namespace {
namespace fs = std::filesystem;

struct MarkerOptions {
  std::string input, rig, out, instrument, joints, report;
  double fps = 30;
  bool deinterlace = false;
};

std::size_t index_of(const Rig& rig, const MarkerOptions& options) {
  if (options.instrument.empty()) {
    if (rig.instruments.size() > 1)
      throw InputError(options.rig, "has several instruments: name one with --instrument");
    return 0;
  }
  const auto found = std::find_if(rig.instruments.begin(), rig.instruments.end(),
                                  [&](const Instrument& instrument) { return instrument.name == options.instrument; });
  if (found == rig.instruments.end())
    throw InputError("--instrument", "name", options.instrument, "an instrument of " + options.rig);
  return static_cast<std::size_t>(found - rig.instruments.begin());
}

// What the joints are compared with must be there before the work.
std::optional<JointRecording> recording_of(const MarkerOptions& options, const Instrument& instrument) {
  if (options.joints.empty()) return std::nullopt;
  for (const auto& [there, key] : {std::pair{instrument.camera_from_rcm.has_value(), "camera_from_rcm"},
                                   {instrument.joints.has_value(), "joints"}})
    if (!there)
      throw InputError(options.rig, fmt::format("--joints needs {} of {}, which the rig lacks", key, instrument.name));
  return read_joint_recording(options.joints, *instrument.joints);
}

struct Seen {
  std::vector<KeyFrame> frames;
  int looked_at = 0, found = 0, flawed = 0;
  bool stopped = false;
};

// Frames of a video lie close together: a few hundred tell as much as all.
Seen seen(const MarkerOptions& options, const Rig& rig, std::size_t instrument, FrameSource& source) {
  constexpr int enough = 400;
  const int every = std::max(1, source.frame_count().value_or(0) / enough);
  const bool deinterlace = options.deinterlace || rig.camera.deinterlace;
  EvenField field(rig.camera.response);
  KeyFrames key_frames(rig, instrument);
  Seen seen;
  Progress progress(source.frame_count());
  int read = 0;
  while (!(seen.stopped = interrupted())) {
    const auto frame = source.next();
    if (!frame) break;
    if (frame->bgr.cols != rig.camera.width_px || frame->bgr.rows != rig.camera.height_px)
      throw InputError(frame->file.empty() ? options.input : frame->file.string(), "size",
                       fmt::format("{} x {}", frame->bgr.cols, frame->bgr.rows),
                       fmt::format("{} x {}, as the rig's camera has it", rig.camera.width_px, rig.camera.height_px));
    if (read++ % every != 0) continue;
    if (frame->flaw) {
      ++seen.flawed;
      continue;
    }
    ++seen.looked_at;
    key_frames.add(deinterlace ? field.of(frame->bgr) : frame->bgr, frame->time_s);
    progress.show(read, fmt::format(", {} in {}", rig.instruments[instrument].name, key_frames.found()));
  }
  seen.found = key_frames.found();
  seen.frames = key_frames.take();
  return seen;
}

int refuse(const MarkerOptions& options, const std::string& why) {
  std::fprintf(stderr, "lapservo: %s: %s; the rig is as it was\n", options.input.c_str(), why.c_str());
  return 1;
}

void print_row(const char* name, double unit, double before, double after, double sigma) {
  std::printf("  %-22s   %10.4f   %10.4f   %8.4f   %+8.4f\n", name, unit * before, unit * after, unit * sigma,
              unit * (after - before));
}

void print_table(const Marker& before, const Marker& after, bool with_seam) {
  std::printf("\n                               before        after      sigma     change\n");
  const MarkerSigmas& sigmas = after.sigmas;
  for (std::size_t i = 0; i < 3; ++i)
    print_row(fmt::format("bands_upper_m[{}] [mm]", i).c_str(), 1e3, before.bands_upper_m[i], after.bands_upper_m[i],
              (*sigmas.bands_upper_m)[i]);
  for (std::size_t i = 0; i < 3; ++i)
    print_row(fmt::format("bands_lower_m[{}] [mm]", i).c_str(), 1e3, before.bands_lower_m[i], after.bands_lower_m[i],
              (*sigmas.bands_lower_m)[i]);
  print_row("wrap_m [mm]", 1e3, before.wrap_m, after.wrap_m, sigmas.wrap_m.value());
  print_row("skew_m [mm]", 1e3, before.skew_m, after.skew_m, sigmas.skew_m.value());
  print_row("gap_rad [mrad]", 1e3, before.gap_rad, after.gap_rad, sigmas.gap_rad.value());
  if (with_seam) print_row("seam_rad [mrad]", 1e3, before.seam_rad, after.seam_rad, sigmas.seam_rad.value());
}

int run_marker(const MarkerOptions& options) {
  const Rig rig = load_rig(options.rig);
  const std::size_t index = index_of(rig, options);
  const Instrument& instrument = rig.instruments[index];
  InputFiles inputs;
  inputs.add(options.input), inputs.add(options.joints);
  std::error_code error;
  if (fs::is_directory(options.input, error)) inputs.add_pictures_in(options.input);
  for (const std::string& out : {options.out, options.report}) inputs.refuse_as_output(out);
  if (!options.report.empty() &&
      fs::weakly_canonical(options.out, error) == fs::weakly_canonical(options.report, error))
    throw InputError(options.out, "is the place for --out and --report, expected two places");
  inputs.add_rig(options.rig, rig);
  inputs.refuse_as_output(options.report);
  const auto recording = recording_of(options, instrument);
  const auto source = open_frame_source(options.input, options.fps);
  AtomicFile out(options.out);
  watch_for_interrupts();

  Seen frames = seen(options, rig, index, *source);
  if (frames.stopped) return refuse(options, "stopped");
  if (const std::string complaint = source->complaint(); !complaint.empty())
    std::fprintf(stderr, "lapservo: %s: %s: what could be read is used\n", options.input.c_str(), complaint.c_str());
  if (frames.found == 0)
    return refuse(
        options, fmt::format("{} is in none of {} frames{}: look at the rig's hues_deg and diameter_m", instrument.name,
                             frames.looked_at, frames.flawed ? fmt::format(" ({} are damaged)", frames.flawed) : ""));
  MarkerCalibration calibration;
  {
    Progress progress(std::nullopt);
    calibration = calibrate_marker(rig, index, std::move(frames.frames), [&](int round, int most) {
      progress.show(round, fmt::format(" of at most {} rounds of fitting", most));
    });
  }
  if (!calibration.refusal.empty()) return refuse(options, calibration.refusal);
  if (recording) {
    const SeamRegistration seam = register_seam(instrument, calibration, *recording);
    if (!seam.refusal.empty()) throw InputError(options.joints, seam.refusal);
    calibration.marker.seam_rad = seam.seam_rad;
    calibration.marker.sigmas.seam_rad = seam.sigma_rad;
  }
  std::printf("%s: found in %d of %d frames; %zu from all sides are used, %zu of them show the seam\n",
              instrument.name.c_str(), frames.found, frames.looked_at, calibration.frames, calibration.seam_views);
  print_table(instrument.marker, calibration.marker, recording.has_value());
  std::printf("\nboundaries miss the print by %.3f px rms before, %.3f px after\n", calibration.before_px,
              calibration.after_px);
  std::printf(
      "diameter_m is the rig's (%.3f mm): pictures tell lengths in diameters; a smaller shaft nearer by looks "
      "the same\n",
      1e3 * instrument.marker.diameter_m);
  if (!recording) std::printf("seam_rad is the rig's: where the seam lies on the instrument takes --joints\n");
  if (!options.report.empty()) {
    write_calibration_report(options.report, instrument, calibration);
    std::printf("report: %s\n", options.report.c_str());
  }
  out.stream() << updated_rig_yaml(options.rig, options.out, index, calibration.marker);
  out.commit();
  std::printf("rig: %s\n", options.out.c_str());
  return 0;
}

void add_calibrate_marker(CLI::App* parent, Run& run_later) {
  auto options = std::make_shared<MarkerOptions>();
  CLI::App* command = parent->add_subcommand(
      "marker", "Measure a mounted marker's print: band lengths, a wrap that is not square, the gap at the seam.");
  command
      ->add_option("input", options->input,
                   "Pictures of a slow full turn about the shaft's axis: a folder, a video, a camera or a stream")
      ->required();
  command->add_option("--rig", options->rig, "The rig with the marker as it was designed")->required();
  command->add_option("--out", options->out, "The rig to write or replace, with the marker as it is; may be --rig's")
      ->required();
  command->add_option("--instrument", options->instrument, "Its name, where the rig has several");
  command->add_option("--joints", options->joints,
                      "CSV of the arm's joints meanwhile (time_s and a column a joint, named as in the rig's joints): "
                      "seam_rad too, which pictures alone can't tell");
  command->add_option("--report", options->report,
                      "HTML page with what the boundaries miss the print by, before and after");
  command->add_flag("--deinterlace", options->deinterlace, "For interlaced video: measure the field of the even rows");
  command->add_option("--fps", options->fps, "Frames per second of a folder of pictures")
      ->capture_default_str()
      ->check(number_between(0.001, 1000.0));
  command->footer(
      "Turn the instrument about its axis once, or a little more, in 20 to 60 s, near and sharp, the whole marker in "
      "view;\n"
      "it may move otherwise too. All numbers are written with one standard deviation each (sigma_...).\n"
      "Example:\n  lapservo calibrate marker turn.mp4 --rig designed.yaml --out rig.yaml --report marker.html");
  command->callback([options, &run_later] { run_later = [options] { return run_marker(*options); }; });
}

}  // namespace

void add_calibrate(CLI::App& app, Run& run_later) {
  CLI::App* calibrate = app.add_subcommand("calibrate", "Measure what a rig says, and write it down.");
  calibrate->require_subcommand(1);
  calibrate->footer(
      "Examples:\n  lapservo calibrate camera boards/ --board 9x6 --square-mm 5 --rig rig.yaml\n  lapservo calibrate "
      "marker turn.mp4 --rig designed.yaml --out rig.yaml");
  add_calibrate_camera(calibrate, run_later);
  add_calibrate_marker(calibrate, run_later);
}

}  // namespace lapservo::app
