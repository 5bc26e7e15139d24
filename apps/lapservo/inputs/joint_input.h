#pragma once

#include <optional>
#include <string>

#include "apps/lapservo/commands/calibrate/calibrate_inputs.h"
#include "lapservo/calibration/recording/joint_recording.h"

namespace lapservo::app {

/// The joints' readings during the frames.
struct JointInput {
  Joints joints;
  internal::JointRecording recording;
  std::string source;  ///< for complaints
};

void add_joint_options(Command command, CalibrateOptions& options, const std::string& help);
void add_joint_topic_option(Command command, std::string& joint_topic);

/// Joints of --joints, a CSV or a bag. Reads the instrument's joints; where it has none, the recording's own four in
/// the order theta, phi, rho, psi. A bag's stamps go with those of `frames`; where these have none, or there is
/// nullptr, its times begin with its joints. Throws InputError for other files.
JointInput read_joint_input(const CalibrateOptions& options, const Instrument& instrument, const FrameSource* frames);

/// The same, and without --joints of the input itself where it is a bag; nullopt without any.
std::optional<JointInput> find_joint_input(const CalibrateOptions& options, const Instrument& instrument,
                                           const FrameSource* frames);

}  // namespace lapservo::app
