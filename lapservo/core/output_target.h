#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <sys/stat.h>

#include "lapservo/core/file_descriptor.h"

namespace lapservo::internal {

/// Where a result is to go, found out before the work. A regular file, there or not yet, is replaced as a whole when
/// the result is complete; anything else that can be written (a FIFO, a terminal, /dev/null, /dev/stdout) is opened and
/// written into, never replaced.
struct OutputTarget {
  std::filesystem::path name;           ///< as it was given, for complaints
  std::filesystem::path file;           ///< the regular file, symbolic links followed; they stay as they are
  std::optional<struct stat> existing;  ///< of that file, whose owner and mode stay
  bool is_stream = false;               ///< not a regular file: see open_stream()

  std::filesystem::path folder() const;  ///< of `file`
  [[noreturn]] void fail(int error) const;
};

/// Throws InputError for an empty name, a folder, a disk, a socket, a file that may not be written.
OutputTarget output_target(const std::filesystem::path& name);

/// To write into what is not a regular file. Waits for a FIFO's reader, as the shell does. Throws InputError.
FileDescriptor open_stream(const OutputTarget& target);

/// Puts the complete file `temporary`, open as `descriptor`, in the target's place: with mode and owner of what stood
/// there, and safely on the disk before the name is. An empty path: a file without a name (O_TMPFILE).
/// Throws InputError; what stood there then still does.
void put_in_place(const OutputTarget& target, int descriptor, const std::filesystem::path& temporary);

}  // namespace lapservo::internal
