#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace lapservo::internal {

/// The order of the steps: each is measured with what those before it changed.
inline constexpr std::array<std::string_view, 5> calibration_order{"camera", "colour", "marker", "registration",
                                                                   "check"};

/// One step of a rig's calibration that was done.
struct CalibrationStep {
  std::string name;     ///< a word: camera, colour, ...
  std::string command;  ///< as a user types it, the input included
  std::string inputs;   ///< what was read: input_state() of it
  std::string when;     ///< UTC, ISO 8601
};

/// The calibrations of a rig in their order, and the rig's content after the last of them: RIG.calibration.yaml beside
/// the rig.
struct CalibrationRecord {
  std::string rig;  ///< rig_state(); empty when nothing was done
  std::vector<CalibrationStep> steps;

  /// Nullptr when it was not done.
  const CalibrationStep* find(const std::string& name) const;
  /// In the place of one of that name, and of all that come after it in calibration_order, whether it was done before
  /// or is done for the first time: they were measured with what it changes.
  void add(const CalibrationStep& step);
};

/// Where the record of a rig stands.
std::filesystem::path record_path(const std::filesystem::path& rig);

/// An empty one when there is none. Throws InputError when there is one that can't be read.
CalibrationRecord read_record(const std::filesystem::path& path);
/// Appears whole or not at all. Throws InputError when it can't be written.
void write_record(const std::filesystem::path& path, const CalibrationRecord& record);

/// A fingerprint of a file's bytes (FNV-1a), to find out whether it has changed. Empty for a pipe, whose
/// bytes are gone when they are read, and when it can't be read.
std::string content_state(const std::filesystem::path& path);

/// The same of a rig's file, and of the camera's and tools' files that it names. Throws as load_rig().
std::string rig_state(const std::filesystem::path& rig);

/// The same for recordings, which are large, by size and time of change: of a file, or of a folder's files together.
/// Empty for what is no file: a camera, a stream.
std::string input_state(const std::filesystem::path& path);

}  // namespace lapservo::internal
