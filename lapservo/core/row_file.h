#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "lapservo/core/output_target.h"

namespace lapservo::internal {

/// A table of a long run, which may be killed: each row is written when it comes, to `PATH.part`, which commit()
/// renames to PATH. Without commit() it is removed, and the earlier PATH stays. If the process is killed, or can't
/// write on, or can't rename it, PATH.part stays with all whole rows. The next run of that PATH overwrites it with its
/// first row if it begins with the same header and its writer is gone; any other file of that name is kept, and
/// refused. Rows for a PATH that is no regular file are written into it as they come. See OutputTarget.
class RowFile {
 public:
  /// Throws InputError at once when it can't be written.
  RowFile(const std::filesystem::path& path, std::string_view header);
  ~RowFile();
  RowFile(const RowFile&) = delete;
  RowFile& operator=(const RowFile&) = delete;

  /// A row or several, each without its line's end. Throws InputError when it can't be written.
  void add(std::string_view row);
  void commit();
  /// Ends it unfinished: the earlier PATH stays, and PATH.part with the rows so far. Returns where they are.
  std::filesystem::path leave();

 private:
  void open_part();
  void write(const std::string& text);
  void begin();

  OutputTarget target_;
  std::filesystem::path part_;  ///< empty when there is none of ours
  FileDescriptor file_;
  std::string header_;
  bool ours_ = false;   ///< nothing in it is another run's
  bool begun_ = false;  ///< whether the header is written
};

}  // namespace lapservo::internal
