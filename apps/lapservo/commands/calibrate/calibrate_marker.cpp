#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>
#include <vector>

#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "lapservo/calibration/marker/marker_measurement.h"

namespace lapservo::app {
using namespace internal;
namespace {

void print_table(const std::vector<CalibratedNumber>& numbers) {
  std::printf("\n                               before        after      sigma     change\n");
  for (const CalibratedNumber& n : numbers)
    std::printf("  %-22s   %10.4f   %10.4f   %8.4f   %+8.4f\n", n.name.c_str(), n.before, n.after, n.sigma,
                n.after - n.before);
}

// Where all bands are longer or shorter by the same part.
void print_scale(const Marker& before, const Marker& after) {
  const double scale = after.length_m() / before.length_m();
  bool alike = std::abs(scale - 1) > 0.01;
  for (const auto& [was, is] :
       {std::pair{before.bands_upper_m, after.bands_upper_m}, {before.bands_lower_m, after.bands_lower_m}})
    for (std::size_t i = 0; i < was.size(); ++i)
      alike &= std::abs(is[i] / was[i] - scale) < 0.3 * std::abs(scale - 1) + 1e-4 / was[i];
  if (alike)
    std::printf(
        "all bands are %.1f %% %s than the rig's: the printer scaled the sheet, or diameter_m is as much too %s: "
        "measure the print's length and the shaft's diameter by callipers\n",
        100 * std::abs(scale - 1), scale > 1 ? "longer" : "shorter", scale > 1 ? "large" : "small");
}

}  // namespace

int calibrate_marker(const CalibrateOptions& options) {
  InstrumentJob job(options);
  const Instrument& instrument = job.instrument();
  std::optional<JointInput> joints;
  if (!options.joints.empty()) {
    expect_registration(instrument, options.rig, "--joints");
    joints = find_joint_input(options, job.rig, job.index, job.frames.get());
    joints.value().source = options.joints;
  }
  job.begin();
  const MarkerCalibration calibration = measure_marker(job.rig, job.index, job.recording(), joints, watched_job());
  say_complaint(options.input, calibration.read.complaint);
  if (!calibration.refusal.empty()) return job.refuse(calibration.refusal);
  std::printf("%s: found in %d of %d frames; %zu from all sides are used, %zu of them show the seam\n",
              instrument.name.c_str(), calibration.found, calibration.read.looked_at, calibration.frames,
              calibration.seam_views);
  print_table(calibrated_numbers(instrument.marker, calibration.marker, joints.has_value()));
  std::printf("\nboundaries miss the print by %.3f px rms before, %.3f px after\n", calibration.before_px,
              calibration.after_px);
  print_faults(calibration.faults);
  print_scale(instrument.marker, calibration.marker);
  std::printf(
      "diameter_m is the rig's (%.3f mm): images give lengths in diameters; a smaller shaft nearer by looks the same\n",
      1e3 * instrument.marker.diameter_m);
  if (calibration.seam_may_lag)
    std::printf(
        "the images look compressed, and the turn does not go both ways: if they come from a video, which leaves the "
        "seam a little behind, psi is some mrad off; turn the instrument there and back\n");
  if (!joints) std::printf("seam_rad is the rig's: where the seam lies on the instrument takes --joints\n");
  job.rig.instruments[job.index].marker = calibration.marker;
  return job.write();
}

void add_calibrate_marker(Command parent) {
  const auto job = [](const CalibrateOptions& options, const Command& command) {
    if (options.joints.empty())
      command.refuse({"--joint-topic"}, "is of the bag of --joints, expected --joints with it");
    return calibrate_marker(options);
  };
  auto [command, options] = parent.add_subcommand<CalibrateOptions>(
      "marker", "Measure a mounted marker's print: band lengths, a wrap that is not square, the gap at the seam.", job);
  command.add_option(
      "input", options.input, required(),
      "Images of a slow full turn about the shaft's axis: a folder, a video, a bag, a camera or a stream");
  add_calibrate_options(command, options);
  add_joint_options(command, options,
                    "CSV of the arm's joints meanwhile (time_s and a column a joint, named as in the rig's joints), or "
                    "a bag, the input itself for example: for seam_rad too, which images alone can't determine");
  command.footer(
      "Turn the instrument about its axis once, or a little more, in 20 to 60 s, near and sharp, the whole marker in "
      "view;\n"
      "it may move otherwise too. For a compressed video turn it there and back. All numbers are written with one "
      "standard deviation each (sigma_...).\n"
      "Example:\n  lapservo calibrate marker turn.mp4 --rig designed.yaml --out rig.yaml");
}

}  // namespace lapservo::app
