#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "apps/lapservo/inputs/frame_input.h"
#include "lapservo/calibration/recording/joint_recording.h"
#include "lapservo/vision/observation.h"

namespace lapservo::app {

/// A recording of one instrument or more, and of its joints.
struct RecordingOptions : FrameOptions {
  std::string input, rig, joints, joint_topic;
};
void add_joint_options(Command command, RecordingOptions& options, const std::string& help);
void add_joint_topic_option(Command command, std::string& joint_topic);

/// Throws InputError for a --joint-topic where neither --joints nor without it the input is a bag.
void refuse_idle_joint_topic(const RecordingOptions& options);

/// Joints of --joints, a CSV or a bag; without --joints of the input itself where it is a bag that has them, else
/// nullopt. Reads the instrument's joints; where it has none, the recording's own four in the order theta, phi, rho,
/// psi. A bag's stamps go with those of `frames`; where these have none, or there is nullptr, its times begin with its
/// joints. Says on stderr where they are those of an arm of another name. Throws InputError for other files, and as
/// refuse_idle_joint_topic().
std::optional<internal::JointInput> find_joint_input(const RecordingOptions& options, const Rig& rig, std::size_t index,
                                                     const FrameSource* frames);

/// The readings of the joints of a tool's wrist during the frames.
struct WristInput {
  std::optional<internal::JointInput> readings;
  /// Why there are none, or none that a frame's stamp names, with the remedy; empty for a tool without a wrist.
  std::string none;
  /// The frames in which the marker was measured, and whether one of them has a tip.
  std::optional<double> first_s = {};
  double last_s = 0;
  bool has_tip = false;

  void add(const Observation& observation, double time_s);
};

/// For one of the rig's instruments. In one bag the rig's image_delay_s, where it `counts`, has to fit what shows when
/// images and joints were recorded; with other recordings one line on stderr says that it counts.
WristInput find_wrist_input(const RecordingOptions& options, const Rig& rig, std::size_t index,
                            const FrameSource& frames, bool counts);
/// At a frame's stamp, in the order of Tool::wrist; empty where they are not known.
std::vector<double> wrist_at(const WristInput& wrist, const Instrument& instrument, double frame_s);
/// Why a topic's or file's readings, though they have the names of the wrist's joints, may be those of another of the
/// rig's arms; empty where they are not, as of a topic .../INSTRUMENT/measured_js, and without a wrist.
std::string other_wrist_text(const std::string& source, const Rig& rig, std::size_t index);
/// Why an instrument's tip is not known, with the remedy; empty where it is, and without a tool.
std::string no_tip_text(const Instrument& instrument, const WristInput& wrist);

/// Says on stderr which point the tip is where its tool's file ends on an axis; nothing of other tools.
void say_axis_tip(const Instrument& instrument);

/// Why none of its frames has a tip though no_tip_text() is empty: the times of the frames and of the readings; empty
/// where one has, and without frames or readings.
std::string no_reading_text(const Instrument& instrument, const WristInput& wrist);

}  // namespace lapservo::app
