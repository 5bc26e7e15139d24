#pragma once

#include <filesystem>
#include <string_view>

#include "lapservo/core/output_target.h"

namespace lapservo::internal {

/// A file beside its target until it is complete. It has no name where the file system knows such files, so that
/// nothing is left of a process that is killed. Else it is named `.lapservo-PID-N` with the target's extension, and
/// locked: the next one made in that folder removes those whose writer is gone.
class TemporaryFile {
 public:
  enum class Name { if_needed, always };
  /// The target must be a regular file and outlive this. `always`: for encoders that open it by its name.
  /// Throws InputError when the folder can't be written.
  explicit TemporaryFile(const OutputTarget& target, Name name = Name::if_needed);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  int descriptor() const { return file_.number(); }
  const std::filesystem::path& path() const { return path_; }  ///< empty without a name
  /// See put_in_place().
  void commit();

 private:
  void make_named();

  const OutputTarget& target_;
  std::filesystem::path path_;
  FileDescriptor file_;
};

/// Locks an open file or folder for as long as it is open. False when somebody else has it.
bool lock(const FileDescriptor& file);

}  // namespace lapservo::internal
