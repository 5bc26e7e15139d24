#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_steps.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"
#include "lapservo/rig/rig_writer.h"

namespace lapservo::app {
using namespace internal;
namespace {

bool is_table(const std::string& input) {
  return std::filesystem::path(input).extension() == ".csv";
}

void print_numbers(const Instrument& before, const Registration& registration) {
  std::printf("\n                               before        after      sigma\n");
  for (const CalibratedNumber& n : registered_numbers(before, registration))
    std::printf("  %-22s   %10s   %10.4f   %8.4f\n", n.name.c_str(),
                std::isfinite(n.before) ? fmt::format("{:.4f}", n.before).c_str() : "-", n.after, n.sigma);
  if (!registration.arm) return;
  const Joints& joints = registration.arm->joints;
  const auto& backlash = registration.arm->backlash;
  std::printf("  joints.sign: %+.0f %+.0f %+.0f %+.0f\n", joints.sign[0], joints.sign[1], joints.sign[2],
              joints.sign[3]);
  std::printf("  backlash behind the readings (not written): theta %.1f, phi %.1f mrad, rho %.2f mm, psi %.1f mrad\n",
              1e3 * backlash[0], 1e3 * backlash[1], 1e3 * backlash[2], 1e3 * backlash[3]);
}

void print_residuals(const Registration& registration) {
  const double position_mm = 1e3 * rms(registration.residuals, &RegistrationResidual::position_m);
  if (!registration.arm) {
    std::printf("\naxes miss the RCM by %.2f mm rms in %zu frames\n", position_mm, registration.residuals.size());
    return;
  }
  std::printf(
      "\nmarkers are %.2f mm, %.2f mrad (axis), %.2f mrad (about it) rms from where the joints have them, in %zu "
      "frames\n",
      position_mm, 1e3 * rms(registration.residuals, &RegistrationResidual::axis_rad),
      1e3 * rms(registration.residuals, &RegistrationResidual::roll_rad), registration.residuals.size());
}

// Where it holds, and what it is worth beside that.
void print_reach(const Marker& marker, const Registration& registration) {
  if (!registration.arm) return;
  constexpr double beyond_rad = 0.52, beyond_m = 0.02;
  const auto within = placement_sigma_beyond(marker, registration, 0, 0);
  const auto beyond = placement_sigma_beyond(marker, registration, beyond_rad, beyond_m);
  std::printf(
      "it places the marker to %.2f mm and %.1f mrad (one sigma) where %s, to %.2f mm and %.1f mrad 30 degrees and 20 "
      "mm beyond\n",
      1e3 * within.place_m, 1e3 * within.axis_rad,
      ranges_text(registration.arm->joints, registration.arm->ranges).c_str(), 1e3 * beyond.place_m,
      1e3 * beyond.axis_rad);
}

}  // namespace

int calibrate_registration(const CalibrateOptions& options) {
  Rig rig = load_rig(options.rig);
  const std::size_t index = instrument_meant(rig, options);
  Instrument instrument = rig.instruments[index];
  refuse_outputs_over_inputs(options, rig);
  const auto frames = is_table(options.input) ? nullptr : open_frames(options.input, options, &rig.camera);
  const auto joints = find_joint_input(options, instrument, frames.get());
  if (joints) instrument.joints = joints->joints;
  AtomicFile out(options.out);
  watch_for_interrupts();
  DvrkOutput dvrk(options.dvrk, joints.has_value());

  const MeasuredPoses poses =
      frames ? poses_in_frames(rig, index, {*frames, options.input, options.deinterlace}, watched_job())
             : poses_in_table(options.input, instrument.name);
  if (poses.read.stopped) return refuse_calibration(options, "stopped");
  say_complaint(options.input, poses.read.complaint);
  if (!poses.none.empty()) return refuse_calibration(options, poses.none);
  const Registration registration = joints ? register_arm(instrument, poses.all, joints->recording, joints->source)
                                           : register_rcm(instrument, poses.all);
  if (!registration.refusal.empty()) return refuse_calibration(options, registration.refusal);
  print_numbers(instrument, registration);
  print_residuals(registration);
  print_reach(instrument.marker, registration);
  print_faults(registration.faults);
  for (const std::string& what : registration.unknown) std::printf("%s\n", what.c_str());
  rig.instruments[index] = registered(rig.instruments[index], registration);
  out.stream() << rig_yaml(rig, options.out);
  out.commit();
  std::printf("rig: %s\n", options.out.c_str());
  if (registration.arm) dvrk.write(rig.instruments[index], registration.arm->ranges, options.out);
  return 0;
}

void add_calibrate_registration(Command parent, Run& run_later) {
  auto options = std::make_shared<CalibrateOptions>();
  Command command = parent.add_subcommand(
      "registration",
      "Measure where the arm stands before the camera, its joints' signs and offsets, and the video's delay.");
  command
      .add_option("input", options->input,
                  "The marker in motion: a folder, a video, a bag (which brings its joints along), a camera, a stream, "
                  "or a CSV of observations that were tracked without camera_from_rcm")
      .required();
  add_calibrate_options(command, *options);
  add_joint_options(
      command, *options,
      "CSV of the arm's joints meanwhile (time_s and a column a joint, named as in the rig's joints), or a bag; "
      "without it those in the input, where it is a bag. Without any only the RCM's position can be determined");
  add_dvrk_options(command, options->dvrk);
  command.footer(
      "Swing the instrument by 0.5 rad in both directions, insert and withdraw it by 20 mm, turn it by 2 rad, all of "
      "it\n"
      "smoothly for 10 to 60 s, the marker in view. Clocks of joints and video may differ by up to 30 s. theta's "
      "offset\n"
      "stays the rig's: camera_from_rcm turns with it.\n"
      "Example:\n  lapservo calibrate registration motion.mp4 --joints joints.csv --rig rig.yaml --out rig.yaml");
  command.runs(run_later, [options] { return calibrate_registration(*options); });
}

}  // namespace lapservo::app
