#include <cstddef>
#include <cstdio>
#include <utility>

#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "lapservo/calibration/colour/colour_calibration.h"

namespace lapservo::app {
using namespace internal;
namespace {

void print(const Instrument& instrument, const ColourCalibration& calibration) {
  std::printf("%s: found in %d of %zu frames before, in %d after\n\n          hue before   after   sigma [deg]\n",
              instrument.name.c_str(), calibration.found_before, calibration.frames, calibration.found);
  for (std::size_t band = 0; band < 3; ++band)
    std::printf("  band %zu   %8.1f   %7.1f   %5.1f\n", band, instrument.marker.hues_deg[band],
                calibration.hues_deg[band], calibration.sigma_hues_deg[band]);
  std::printf("\nresponse: %s\n", calibration.response_found.c_str());
  print_faults(calibration.faults);
}

}  // namespace

int calibrate_colour(const CalibrateOptions& options) {
  InstrumentJob job(options);
  job.begin();
  const ColourCalibration calibration =
      measure_colour(job.rig, job.index, job.recording(), options.replace_response, watched_job());
  say_complaint(options.input, calibration.read.complaint);
  if (!calibration.refusal.empty()) return job.refuse(calibration.refusal);
  print(job.instrument(), calibration);
  job.rig = with_colour(std::move(job.rig), job.index, calibration);
  return job.write();
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
