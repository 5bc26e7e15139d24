#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <sys/stat.h>

#include "lapservo/core/file_descriptor.h"

namespace lapservo::internal {

/// The place of a result. A regular file, there or not yet, is replaced as a whole when the result is complete;
/// anything else (a FIFO, a terminal, /dev/null) is opened and written into, as are our own standard output and error,
/// whatever the shell has them lead to.
struct OutputTarget {
  /// Throws InputError for an empty name, a folder, a disk, a link to no file, and what may not be written.
  explicit OutputTarget(const std::filesystem::path& name);

  bool is_stream() const { return file.empty(); }
  [[noreturn]] void fail(int error, const std::string& kept = "") const;
  [[noreturn]] void fail_writing(int error, const std::string& kept = "") const;

  std::filesystem::path name;  ///< as it was given, for complaints
  std::filesystem::path file;  ///< the regular file, symbolic links followed; empty for a stream
  std::optional<struct stat> existing;
  int own_descriptor = -1;  ///< of the stream that is our standard output or error

 private:
  void take(const struct stat& status);
};

/// To write into a stream. Waits for a FIFO's reader, as the shell does. Throws InputError.
FileDescriptor open_stream(const OutputTarget& target);

/// Renames the complete file `temporary`, open as `descriptor`, to the target's name, when it is safely on the disk:
/// with mode and owner of the file that it replaces. Clears `temporary`. Where that fails, throws InputError naming the
/// temporary file, which stays, as does the one to be replaced.
void put_in_place(const OutputTarget& target, int descriptor, std::filesystem::path& temporary);

/// A file beside its target, FILE.PID-N.part, until it is complete. A process that is killed leaves it there, as does
/// put_in_place() where it fails.
class TemporaryFile {
 public:
  /// The target must be a regular file. Throws InputError when it can't be made.
  explicit TemporaryFile(OutputTarget target);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  const std::filesystem::path& path() const { return path_; }
  /// Throws InputError when it can't be written.
  void write(std::string_view bytes);
  /// See put_in_place().
  void commit();

 private:
  OutputTarget target_;
  std::filesystem::path path_;  ///< empty once it has its target's name
  FileDescriptor file_;
};

}  // namespace lapservo::internal
