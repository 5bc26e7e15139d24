#include "apps/lapservo/commands/calibrate/dvrk_output.h"

#include <chrono>
#include <cstdio>
#include <thread>

#include <fmt/format.h>

#include "apps/lapservo/cli/interrupt.h"
#include "apps/lapservo/inputs/transports.h"
#include "lapservo/core/error.h"
#include "lapservo/crtk/arm_pose.h"
#include "lapservo/crtk/crtk_robot.h"
#include "lapservo/crtk/dvrk_frames.h"
#include "lapservo/robot/steady_clock.h"

namespace lapservo::app {
using namespace internal;
namespace {

constexpr double wait_s = 15;

}  // namespace

void add_dvrk_options(Command command, DvrkOptions& options) {
  command.add_option("--base-frame", options.base_frame,
                     "Also write what dVRK takes as JSON: the arm's base_frame for system.json; with --endoscope its "
                     "entry of suj-fixed.json");
  command.add_option("--reference-frame", options.reference_frame,
                     "Name of the base frame's reference: the camera's frame in dVRK's convention (x left, y up)");
  command.add_option("--endoscope", options.endoscope,
                     "The arm that held the endoscope during the recording and still stands there: ros2:ECM, ros1:ECM");
  command.add_option(
      "--set-base-frame", options.set_base_frame,
      "Also publish it on this arm's set_base_frame: ros2:PSM1, ros1:PSM1; not while it is teleoperated");
}

DvrkOutput::DvrkOutput(const DvrkOptions& options, bool has_joints) : options_(options) {
  if (!has_joints && !(options.base_frame.empty() && options.set_base_frame.empty()))
    throw InputError("--base-frame", "needs the arm's joints, expected --joints or a bag with them");
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
            options.endoscope, wait_s, transports_.unpublished(options.endoscope, "--endoscope", "local/measured_cp")));
  endoscope_ = pose.newest();
}

void DvrkOutput::write(const Instrument& instrument, const JointRanges& ranges, const std::string& source) {
  if (!file_ && options_.set_base_frame.empty()) return;
  const DvrkBase base = dvrk_base(instrument, ranges, source);
  std::printf("dVRK's kinematics put the shaft within %.2f mrad of this registration%s\n", 1e3 * base.worst_axis_rad,
              base.worst_axis_rad > 2e-3 ? ": the encoder of pitch is off, see joints.offset" : "");
  if (file_) {
    file_->stream() << (endoscope_ ? dvrk_suj_fixed_json(base.camera_from_base, instrument.name, *endoscope_)
                                   : dvrk_base_frame_json(base.camera_from_base, options_.reference_frame));
    file_->commit();
    std::printf("base frame: %s\n", options_.base_frame.c_str());
  }
  if (!options_.set_base_frame.empty()) publish(base.camera_from_base);
}

void DvrkOutput::publish(const Rigid3& camera_from_base) {
  const Address arm = address_of(options_.set_base_frame, "--set-base-frame");
  Transport& transport = transports_.get(arm.transport, "--set-base-frame");
  const std::string topic = topic_of(arm.name, "set_base_frame");
  const auto say = transport.place_publisher(topic);
  if (!wait_until([&] { return !transport.readers(topic).empty(); }, wait_s))
    throw InputError("--set-base-frame", fmt::format("{} has no reader within {:.0f} s", topic, wait_s));
  // Again and again: a reader that is known here may not know this writer yet.
  constexpr int times = 10;
  for (int i = 0; i < times; ++i) {
    say({transport.stamp_now_s(), options_.reference_frame, dvrk_from_camera() * camera_from_base});
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
  std::printf("base frame: published on %s\n", topic.c_str());
}

}  // namespace lapservo::app
