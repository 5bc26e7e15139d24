#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/inputs/frame_input.h"
#include "lapservo/calibration/camera/camera_measurement.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/rig/rig.h"

namespace lapservo::app {

/// Options of `calibrate registration` for dVRK's software.
struct DvrkOptions {
  std::string base_frame, reference_frame = "camera", endoscope, set_base_frame;
};

/// Options of the subcommands that measure one instrument of a rig from frames.
struct CalibrateOptions : FrameOptions {
  std::string input, rig, out, instrument, joints, report, joint_topic;
  DvrkOptions dvrk;  ///< of registration only
};

/// A board as its options describe it.
struct BoardOptions {
  std::string corners, dictionary;
  std::optional<double> square_mm, marker_mm;
};
void add_board_options(Command command, BoardOptions& options, bool required);
/// `square_mm` is given. Throws InputError for corners that are no board's.
internal::Board board_of(const BoardOptions& options);

/// All but the input and the joints, which each subcommand describes itself.
void add_calibrate_options(Command command, CalibrateOptions& options);

/// Those options that say how the recording is read and which instrument is meant.
void add_recording_options(Command command, CalibrateOptions& options);

/// Place in the rig of the instrument of that name, or of the only one where none is given. Throws InputError where
/// that is open or unknown.
std::size_t named_instrument(const Rig& rig, const std::string& name, const std::string& rig_file);
inline std::size_t instrument_meant(const Rig& rig, const CalibrateOptions& options) {
  return named_instrument(rig, options.instrument, options.rig);
}

/// Throws InputError when a result would go over an input or another result, a page over the rig, or
/// the rig over its camera's or tools' files.
void refuse_outputs_over_inputs(const CalibrateOptions& options, const Rig& rig);

/// Prints on stderr the parts that a source could not read.
void say_complaint(const std::string& input, const std::string& complaint);

/// Prints the faults of a recording that a calibration sees beyond the noise.
void print_faults(const std::vector<std::string>& faults);

/// Ends a job at Ctrl-C and shows its progress (progress.h), until it is destroyed.
internal::JobWatch watched_job();

/// Writes the rig with what was measured, and says where it is; returns the exit code.
int write_rig(internal::AtomicFile& out, const Rig& rig, const std::string& path);

/// Says on stderr why nothing was written; returns the exit code.
int refuse_calibration(const CalibrateOptions& options, const std::string& why);

}  // namespace lapservo::app
