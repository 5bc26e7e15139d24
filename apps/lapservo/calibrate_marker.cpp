#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/calibrate_inputs.h"
#include "apps/lapservo/frame_input.h"
#include "apps/lapservo/interrupt.h"
#include "apps/lapservo/joint_input.h"
#include "apps/lapservo/marker_report.h"
#include "apps/lapservo/progress.h"
#include "apps/lapservo/subcommands.h"
#include "lapservo/calibration/marker_calibration.h"
#include "lapservo/calibration/seam_registration.h"
#include "lapservo/core/angles.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/io/frame_source.h"
#include "lapservo/rig/rig_updater.h"

namespace lapservo::app {
using namespace internal;
namespace {

// What the joints are compared with must be there before the work.
std::optional<JointRecording> recording_of(const CalibrateOptions& options, const Instrument& instrument,
                                           const FrameSource& frames) {
  if (options.joints.empty()) return std::nullopt;
  for (const auto& [there, key] : {std::pair{instrument.camera_from_rcm.has_value(), "camera_from_rcm"},
                                   {instrument.joints.has_value(), "joints"}})
    if (!there)
      throw InputError(options.rig, fmt::format("--joints needs {} of {}, which the rig lacks", key, instrument.name));
  return read_joint_input(options, instrument, &frames).recording;
}

struct Seen {
  std::vector<KeyFrame> frames;
  int found = 0;
  FramesRead read;
};

// Frames of a video lie close together: a few hundred tell as much as all.
Seen seen(const CalibrateOptions& options, const Rig& rig, std::size_t instrument, FrameSource& source) {
  constexpr int enough = 400;
  KeyFrames key_frames(rig, instrument);
  Seen seen;
  seen.read = read_frames(options, rig, source, std::max(1, source.frame_count().value_or(0) / enough),
                          [&](const cv::Mat& bgr, double time_s) {
                            key_frames.add(bgr, time_s);
                            return fmt::format(", {} in {}", rig.instruments[instrument].name, key_frames.found());
                          });
  seen.found = key_frames.found();
  seen.frames = key_frames.take();
  return seen;
}

void print_table(const std::vector<CalibratedNumber>& numbers) {
  std::printf("\n                               before        after      sigma     change\n");
  for (const CalibratedNumber& n : numbers)
    std::printf("  %-22s   %10.4f   %10.4f   %8.4f   %+8.4f\n", n.name.c_str(), n.before, n.after, n.sigma,
                n.after - n.before);
}

int run_marker(const CalibrateOptions& options) {
  const Rig rig = load_rig(options.rig);
  const std::size_t index = instrument_meant(rig, options);
  const Instrument& instrument = rig.instruments[index];
  refuse_outputs_over_inputs(options, rig);
  const auto source = open_frames(options.input, options.fps, options.image_topic);
  const auto recording = recording_of(options, instrument, *source);
  AtomicFile out(options.out);
  watch_for_interrupts();

  Seen frames = seen(options, rig, index, *source);
  if (frames.read.stopped) return refuse_calibration(options, "stopped");
  say_complaint(options.input, *source);
  if (frames.found == 0)
    return refuse_calibration(
        options, fmt::format("{} is in none of {} frames{}: look at the rig's hues_deg and diameter_m", instrument.name,
                             frames.read.looked_at,
                             frames.read.flawed ? fmt::format(" ({} are damaged)", frames.read.flawed) : ""));
  MarkerCalibration calibration;
  {
    Progress progress(std::nullopt);
    calibration = calibrate_marker(rig, index, std::move(frames.frames), [&](int round, int most) {
      progress.show(round, fmt::format(" of at most {} rounds of fitting", most));
    });
  }
  if (!calibration.refusal.empty()) return refuse_calibration(options, calibration.refusal);
  if (recording) {
    const SeamRegistration seam = register_seam(instrument, calibration, *recording);
    if (!seam.refusal.empty()) throw InputError(options.joints, seam.refusal);
    calibration.marker.seam_rad = seam.seam_rad;
    calibration.marker.sigmas.seam_rad = seam.sigma_rad;
  }
  std::printf("%s: found in %d of %d frames; %zu from all sides are used, %zu of them show the seam\n",
              instrument.name.c_str(), frames.found, frames.read.looked_at, calibration.frames, calibration.seam_views);
  print_table(calibrated_numbers(instrument.marker, calibration.marker, recording.has_value()));
  std::printf("\nboundaries miss the print by %.3f px rms before, %.3f px after\n", calibration.before_px,
              calibration.after_px);
  std::printf(
      "diameter_m is the rig's (%.3f mm): pictures tell lengths in diameters; a smaller shaft nearer by looks "
      "the same\n",
      1e3 * instrument.marker.diameter_m);
  if (!recording) std::printf("seam_rad is the rig's: where the seam lies on the instrument takes --joints\n");
  if (!options.report.empty()) {
    write_marker_report(options.report, instrument, calibration);
    std::printf("report: %s\n", options.report.c_str());
  }
  out.stream() << updated_rig_yaml(options.rig, options.out, index, calibration.marker);
  out.commit();
  std::printf("rig: %s\n", options.out.c_str());
  return 0;
}

}  // namespace

void add_calibrate_marker(Command parent, Run& run_later) {
  auto options = std::make_shared<CalibrateOptions>();
  Command command = parent.add_subcommand(
      "marker", "Measure a mounted marker's print: band lengths, a wrap that is not square, the gap at the seam.");
  command
      .add_option("input", options->input,
                  "Pictures of a slow full turn about the shaft's axis: a folder, a video, a bag, a camera or a stream")
      .required();
  add_calibrate_options(command, *options);
  add_joint_options(
      command, *options,
      "CSV of the arm's joints meanwhile (time_s and a column a joint, named as in the rig's joints), or a "
      "bag, the input itself for example: seam_rad too, which pictures alone can't tell");
  command.add_option("--report", options->report,
                     "HTML page with what the boundaries miss the print by, before and after");
  command.footer(
      "Turn the instrument about its axis once, or a little more, in 20 to 60 s, near and sharp, the whole marker in "
      "view;\n"
      "it may move otherwise too. All numbers are written with one standard deviation each (sigma_...).\n"
      "Example:\n  lapservo calibrate marker turn.mp4 --rig designed.yaml --out rig.yaml --report marker.html");
  command.runs(run_later, [options] { return run_marker(*options); });
}

}  // namespace lapservo::app
