#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/lapservo/cli/subcommands.h"
#include "apps/lapservo/inputs/joint_input.h"
#include "lapservo/calibration/camera/camera_measurement.h"
#include "lapservo/calibration/recording/frame_recording.h"
#include "lapservo/core/atomic_file.h"
#include "lapservo/report/html_report.h"
#include "lapservo/rig/rig.h"

namespace lapservo::app {

/// Options of `calibrate registration` for dVRK's software.
struct DvrkOptions {
  std::string base_frame, reference_frame = "camera", endoscope, set_base_frame;
};

/// Options of the subcommands that measure one instrument of a rig from frames.
struct CalibrateOptions : RecordingOptions {
  std::string out, instrument, report;
  bool replace_response = false;  ///< of colour only
  DvrkOptions dvrk;               ///< of registration only
};

/// A board as its options describe it.
struct BoardOptions {
  std::string corners, dictionary;
  std::optional<double> square_mm, marker_mm;
};
/// `always`: whether --board and --square-mm are required.
void add_board_options(Command command, BoardOptions& options, bool always);
/// `square_mm` is given. Throws InputError for corners that are no board's.
internal::Board board_of(const BoardOptions& options);

/// All but the input and the joints, which each subcommand describes itself.
void add_calibrate_options(Command command, CalibrateOptions& options);

/// Those options that say how the recording is read and which instrument is meant.
void add_recording_options(Command command, CalibrateOptions& options);

/// Place in the rig of the instrument of that name, or of the only one where none is given. Throws InputError where
/// that is open or unknown.
std::size_t instrument_meant(const Rig& rig, const std::string& name, const std::string& rig_file);

/// Prints on stderr the parts that a source could not read.
void say_complaint(const std::string& input, const std::string& complaint);

/// Prints the faults of a recording that a calibration sees beyond the noise.
void print_faults(const std::vector<std::string>& faults);

/// Ends a job at Ctrl-C and shows its progress (progress.h), until it is destroyed.
internal::JobWatch watched_job();

/// The rig's file as a calibration reads it: its content_state(), made before load_rig().
class RigAsRead {
 public:
  explicit RigAsRead(const std::string& rig);
  /// Throws InputError where `out` is that file and has another content by now, which would be lost.
  void expect_unchanged(const std::string& out) const;

 private:
  std::string rig_, content_;
};

/// Says on stderr why there is no result; returns the exit code.
int refuse(const std::string& source, const std::string& why);

/// A subcommand that measures one instrument of a rig, from the frames of its input.
struct InstrumentJob {
  /// Throws InputError where it is open which instrument is meant, and when a result would go over an input or another
  /// result, a page over the rig, or the rig over its camera's or tools' files. `with_frames`: opens the input.
  explicit InstrumentJob(const CalibrateOptions& options, bool with_frames = true);
  /// From now on Ctrl-C lets it end well. Throws InputError where the rig or the page can't be written.
  void begin();
  /// refuse(), where the rig stays as it was.
  int refuse(const std::string& why) const;
  /// Writes the page, if one is wanted, and says where it is.
  void write_page(const internal::Report& report);
  /// Writes the rig with what was measured, and says where it is; returns the exit code. Throws InputError as
  /// RigAsRead::expect_unchanged().
  int write();

  const Instrument& instrument() const { return rig.instruments[index]; }
  internal::FrameRecording recording() const { return {*frames, options.input, options.deinterlace}; }

  const CalibrateOptions& options;
  RigAsRead read;
  Rig rig;
  std::size_t index;
  std::unique_ptr<FrameSource> frames;
  std::optional<internal::AtomicFile> out, page;
};

/// Options of `calibrate camera`.
struct CalibrateCameraOptions : FrameOptions {
  std::vector<std::string> inputs;
  std::string rig, out, camera_info;
  BoardOptions board;
  std::size_t views = 30;

  /// Where the rig goes; empty without one.
  const std::string& rig_out() const { return rig.empty() || !out.empty() ? out : rig; }
  std::string input() const { return inputs.size() == 1 ? inputs.front() : inputs.front() + " and others"; }
};

// The jobs of the subcommands of these names. Each returns the exit code, 0 or 1, and throws InputError for bad input.
int calibrate_camera(const CalibrateCameraOptions& options);
int calibrate_colour(const CalibrateOptions& options);
int calibrate_marker(const CalibrateOptions& options);
int calibrate_registration(const CalibrateOptions& options);
/// `out` stays empty: the page is the report.
int check(const CalibrateOptions& options);

/// Options of `lapservo record`.
struct RecordOptions {
  std::string camera, robot, rig, out, move, joint_limits, instrument;
  double duration_s = 20, scale = 1, fps = 30;
  int setpoint_readers = 1;
  bool until_enter = false, enable_motion = false;
};

/// Records until the time is up, the motion done, Ctrl-C or, with that option, a line on standard input. Exit code 1
/// when no image came or the motion did not end well; the bag keeps what was recorded.
int record(const RecordOptions& options);

}  // namespace lapservo::app
