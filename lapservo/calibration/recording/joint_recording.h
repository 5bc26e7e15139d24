#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "lapservo/core/csv.h"
#include "lapservo/rig/rig.h"

namespace lapservo::internal {

/// Whose the four joints of a recording are: an arm's (rad, rad, m, rad) or a wrist's, all in rad.
enum class JointsOf { arm, wrist };

/// Joints over time.
struct JointRecording {
  std::vector<double> time_s;                 ///< rises
  std::vector<std::array<double, 4>> joints;  ///< as Joints::names has them
  int repeated = 0;                           ///< readings passed over: the one before has the same stamp
  int of_other_arms = 0;                      ///< messages passed over: they lack a joint of the rig
  int left_out = 0;                           ///< messages passed over: their stamps are none, late or stand out
  int no_numbers = 0;                         ///< readings passed over: not finite
  int steps = 0;                              ///< how often the clock that stamps them was set
  int steps_by_gap = 0;                       ///< how often of these the recorder's showed no later time

  /// Between two rows, linearly; nullopt before the first and after the last one, and across pauses of half a second.
  std::optional<std::array<double, 4>> at(double time_s) const;
  /// How many readings were passed over and why, and that the clock was set; empty where nothing is to be said.
  std::string remark() const;
};

/// How often the clock of a topic, or of the joints, was set, and by what times go on.
std::string clock_set_text(const std::string& whose, int steps, int steps_by_gap);

/// The joints' readings during frames.
struct JointInput {
  Joints joints;
  JointRecording recording;
  std::string source;  ///< for complaints
};

/// A CSV of `time_s` and a column a joint (docs/calibration.md). Throws InputError for columns that are missing,
/// numbers that are none, fewer than two rows and times that do not rise. A row that repeats the one before is passed
/// over.
JointRecording read_joint_recording(const std::filesystem::path& path, const Joints& joints,
                                    JointsOf whose = JointsOf::arm);

/// The same of a table that was read already; `source` is named in complaints.
JointRecording joint_recording_of(const CsvTable& table, const std::string& source, const Joints& joints,
                                  JointsOf whose = JointsOf::arm);

/// Throws InputError naming `source` and the joint where numbers are too large for radians and metres, as degrees and
/// millimetres are; of a wrist's joint beyond a turn.
void check_units(const JointRecording& recording, const Joints& joints, const std::string& source, JointsOf whose);

/// The instrument's joints; where it has none, the recording's own four in the order theta, phi, rho, psi. Throws
/// InputError naming `source` when there are not four, and the rig that would name them.
Joints joints_of(const Instrument& instrument, const std::vector<std::string>& recorded, const std::string& source,
                 const std::string& rig);

/// The same motion in steps of at most `step_s`, smooth through the rows (Catmull and Rom's cubic); pauses stay.
JointRecording refined(const JointRecording& recording, double step_s);

/// Turns a joint's readings into where the instrument is behind a gap of this width, in whose middle it begins. A width
/// below 0 is an instrument that leads as one above 0 lets it lag: derivatives go through 0.
void put_behind_gap(JointRecording& recording, std::size_t joint, double width);

}  // namespace lapservo::internal
