#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <thread>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "apps/lapservo/inputs/live_images.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/calibration/registration/registration_measurement.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/core/statistics.h"
#include "lapservo/crtk/arm_pose.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/dvrk_frames.h"
#include "lapservo/rig/joint_travel.h"
#include "lapservo/robot/steady_clock.h"
#include "recordings/bag_endoscope.h"
#include "recordings/open_bag.h"

namespace lapservo::app {
using namespace internal;
namespace {

bool is_table(const std::string& input) {
  return std::filesystem::path(input).extension() == ".csv";
}

constexpr double wait_s = 15;

void add_dvrk_options(Command command, DvrkOptions& options) {
  command.add_option("--base-frame", options.base_frame,
                     "Also write what dVRK takes as JSON: the arm's base_frame for system.json; with --endoscope its "
                     "entry of suj-fixed.json");
  command.add_option("--reference-frame", options.reference_frame,
                     "Name of the base frame's reference, without --endoscope: the camera's frame in dVRK's convention "
                     "(x left, y up)");
  command.add_option("--endoscope", options.endoscope,
                     "With --base-frame: the arm that held the endoscope during the recording and still stands there: "
                     "ros2:ECM, ros1:ECM");
  command.add_option(
      "--set-base-frame", options.set_base_frame,
      "Also publish it on this arm's set_base_frame: ros2:PSM1, ros1:PSM1; not while it is teleoperated");
}

// Options that would be ignored.
void refuse_idle(const DvrkOptions& options, const Command& command) {
  if (options.base_frame.empty() && options.set_base_frame.empty())
    command.refuse({"--endoscope", "--reference-frame"}, "is of dVRK's base frame, expected --base-frame with it");
  if (!options.endoscope.empty())
    command.refuse({"--reference-frame"}, "is not in an entry of suj-fixed.json, expected none with --endoscope");
}

// Before the job: throws InputError for what can't be done, and reads where the ECM stands. Then find(), before the rig
// is written, and write().
class DvrkOutput {
 public:
  // `has_joints`: whether the recording has them.
  DvrkOutput(const DvrkOptions& options, bool has_joints) : options_(options) {
    if (!has_joints && !(options.base_frame.empty() && options.set_base_frame.empty()))
      throw InputError(options.base_frame.empty() ? "--set-base-frame" : "--base-frame",
                       "needs the arm's joints, expected --joints or a bag with them");
    if (!options.set_base_frame.empty()) {
      if (!options.endoscope.empty())
        throw InputError("--set-base-frame",
                         "would be overwritten by the SUJ that follows --endoscope, expected one of the two");
      address_of(options.set_base_frame, "--set-base-frame");
    }
    if (!options.base_frame.empty()) file_.emplace(options.base_frame);
    if (options.endoscope.empty()) return;
    const Address ecm = address_of(options.endoscope, "--endoscope");
    const SteadyClock clock;
    const ArmPose pose(transports_.get(ecm.transport, "--endoscope"), ecm.name, clock);
    if (!wait_until([&] { return pose.newest().has_value(); }, wait_s))
      throw InputError(
          "--endoscope",
          fmt::format(
              "is {}, of which no measured_cp with a stamp came within {:.0f} s (a dVRK stamps it once the arm is "
              "homed): {}",
              options.endoscope, wait_s,
              transports_.unpublished(options.endoscope, "--endoscope", "local/measured_cp")));
    endoscope_ = pose.newest();
  }

  // `ranges`: of the joints' readings. Throws InputError as dvrk_base(), naming `source`, and where nobody reads the
  // topic of --set-base-frame.
  void find(const Instrument& instrument, const JointRanges& ranges, const std::string& source) {
    if (!file_ && options_.set_base_frame.empty()) return;
    base_ = dvrk_base(instrument, ranges, source);
    if (options_.set_base_frame.empty()) return;
    const Address arm = address_of(options_.set_base_frame, "--set-base-frame");
    transport_ = &transports_.get(arm.transport, "--set-base-frame");
    topic_ = topic_of(arm.name, "set_base_frame");
    say_ = transport_->publisher<PlaceMessage>(topic_);
    if (!wait_until([&] { return !transport_->readers(topic_).empty(); }, wait_s))
      throw InputError("--set-base-frame", fmt::format("{} has no reader within {:.0f} s", topic_, wait_s));
  }

  // The base frame that find() found.
  void write(const std::string& instrument) {
    if (!base_) return;
    std::printf("dVRK's kinematics put the shaft within %.2f mrad of this registration%s\n",
                1e3 * base_->worst_axis_rad,
                base_->worst_axis_rad > 2e-3 ? ": the encoder of pitch is off, see joints.offset" : "");
    if (file_) {
      file_->stream() << (endoscope_ ? dvrk_suj_fixed_json(base_->camera_from_base, instrument, *endoscope_)
                                     : dvrk_base_frame_json(base_->camera_from_base, options_.reference_frame));
      file_->commit();
      std::printf("base frame: %s\n", options_.base_frame.c_str());
    }
    if (transport_) publish(base_->camera_from_base);
  }

 private:
  void publish(const Rigid3& camera_from_base) {
    // Again and again: a reader that is known here may not know this writer yet.
    constexpr int times = 10;
    for (int i = 0; i < times; ++i) {
      say_({transport_->stamp_now_s(), options_.reference_frame, dvrk_from_camera() * camera_from_base});
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    std::printf("base frame: published on %s\n", topic_.c_str());
  }

  const DvrkOptions& options_;
  Transports transports_{"lapservo_calibrate"};
  std::optional<AtomicFile> file_;
  std::optional<Rigid3> endoscope_;
  std::optional<DvrkBase> base_;
  Transport* transport_ = nullptr;  // of --set-base-frame
  std::string topic_;
  Transport::Publisher<PlaceMessage> say_;
};

// Why the endoscope did not stand as in one registration; empty where no bag says so.
std::string moved_endoscope(const CalibrateOptions& options) {
  for (const std::string& recording : {options.input, options.joints})
    if (const std::string bag = bag_of(recording); !bag.empty())
      if (const std::string moved = endoscope_motion_text(*open_bag(bag)); !moved.empty())
        return fmt::format("{} of {}: record with the endoscope at rest, or cut the bag to where it rests", moved, bag);
  return "";
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
  InstrumentJob job(options, !is_table(options.input));
  Instrument instrument = job.instrument();
  const auto joints = find_joint_input(options, job.rig, job.index, job.frames.get());
  if (joints) instrument.joints = joints->joints;
  job.begin();
  if (const std::string moved = moved_endoscope(options); !moved.empty()) return job.refuse(moved);
  DvrkOutput dvrk(options.dvrk, joints.has_value());
  const MeasuredPoses poses = job.frames ? poses_in_frames(job.rig, job.index, job.recording(), watched_job())
                                         : poses_in_table(options.input, instrument.name);
  say_complaint(options.input, poses.read.complaint);
  if (!poses.none.empty()) return job.refuse(poses.none);
  const Registration registration = joints ? register_arm(instrument, poses.all, joints->recording, joints->source)
                                           : register_rcm(instrument, poses.all);
  if (!registration.refusal.empty()) return job.refuse(registration.refusal);
  print_numbers(instrument, registration);
  print_residuals(registration);
  print_reach(instrument.marker, registration);
  print_faults(registration.faults);
  for (const std::string& what : registration.unknown) std::printf("%s\n", what.c_str());
  job.rig.instruments[job.index] = registered(job.instrument(), registration);
  if (registration.arm) dvrk.find(job.instrument(), registration.arm->ranges, options.out);
  job.write();
  dvrk.write(instrument.name);
  return 0;
}

void add_calibrate_registration(Command parent) {
  const auto job = [](const CalibrateOptions& options, const Command& command) {
    if (is_table(options.input))
      command.refuse(frame_option_names(), "is of frames, and a CSV of observations has none");
    refuse_idle(options.dvrk, command);
    return calibrate_registration(options);
  };
  auto [command, options] = parent.add_subcommand<CalibrateOptions>(
      "registration",
      "Measure where the arm stands before the camera, its joints' signs and offsets, and the video's delay.", job);
  command.add_option(
      "input", options.input, required(),
      "The marker in motion: a folder, a video, a bag (which brings its joints along), a camera, a stream, "
      "or a CSV of observations that were tracked without camera_from_rcm");
  add_calibrate_options(command, options);
  add_joint_options(
      command, options,
      "CSV of the arm's joints meanwhile (time_s and a column a joint, named as in the rig's joints), or a bag; "
      "without it those in the input, where it is a bag. Without any only the RCM's position can be determined");
  add_dvrk_options(command, options.dvrk);
  command.footer(
      "Swing the instrument by 0.5 rad in both directions, insert and withdraw it by 20 mm, turn it by 2 rad, all of "
      "it\n"
      "smoothly for 10 to 60 s, the marker in view. Clocks of joints and video may differ by up to 30 s. theta's "
      "offset\n"
      "stays the rig's: camera_from_rcm turns with it.\n"
      "Example:\n  lapservo calibrate registration motion.mp4 --joints joints.csv --rig rig.yaml --out rig.yaml");
}

}  // namespace lapservo::app
