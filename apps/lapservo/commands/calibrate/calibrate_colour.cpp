#include <cstddef>
#include <cstdio>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "lapservo/calibration/colour/colour_calibration.h"
#include "lapservo/core/atomic_file.h"

namespace lapservo::app {
using namespace internal;
namespace {

void print(const Instrument& instrument, const ColourCalibration& calibration, std::size_t frames) {
  std::printf("%s: found in %d of %zu frames before, in %d after\n\n          hue before   after   sigma [deg]\n",
              instrument.name.c_str(), calibration.found_before, frames, calibration.found);
  for (std::size_t band = 0; band < 3; ++band)
    std::printf("  band %zu   %8.1f   %7.1f   %5.1f\n", band, instrument.marker.hues_deg[band],
                calibration.hues_deg[band], calibration.sigma_hues_deg[band]);
  std::printf("\nresponse: %s\n", calibration.response_found.c_str());
  print_faults(calibration.faults);
}

}  // namespace

int calibrate_colour(const CalibrateOptions& options) {
  const RigAsRead read(options.rig);
  const Rig rig = load_rig(options.rig);
  const std::size_t index = instrument_meant(rig, options.instrument, options.rig);
  const Instrument& instrument = rig.instruments[index];
  refuse_outputs_over_inputs(options, rig);
  const auto source = open_frames(options.input, options, &rig.camera);
  AtomicFile out(options.out);
  watch_for_interrupts();

  const ColourMeasurement measured = measure_colour(rig, index, {*source, options.input, options.deinterlace},
                                                    options.replace_response, watched_job());
  const ColourCalibration& calibration = measured.calibration;
  if (!measured.read.stopped) say_complaint(options.input, measured.read.complaint);
  if (!calibration.refusal.empty()) return refuse_calibration(options, calibration.refusal);
  print(instrument, calibration, measured.frames);
  return write_rig(out, with_colour(rig, index, calibration), options.out, read);
}

void add_calibrate_colour(Command parent) {
  auto [command, options] = parent.add_subcommand<CalibrateOptions>(
      "colour", "Measure the hues of a mounted marker's bands as the camera has them, and how it encodes light.",
      calibrate_colour);
  command.add_option("input", options.input, required(),
                     "The marker in motion: images, a folder, a video, or a camera until Ctrl-C");
  add_calibrate_options(command, options);
  command.add_flag("--replace-response", options.replace_response,
                   "Also a response that calibrate camera measured (sigma_response), which stays else");
  command.footer(
      "Move the instrument through the image and turn it, 10 s or more, wholly in view and not overexposed. The rig's\n"
      "hues may be up to 60 degrees off; the response is written where the frames show another than the rig's.\n"
      "Example:\n  lapservo calibrate colour motion.mp4 --rig rig.yaml --out rig.yaml");
}

}  // namespace lapservo::app
