#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "lapservo/core/output_target.h"

namespace lapservo::internal {

/// A table of a long run, which may be killed: each row is written when it comes, to `PATH.part`, which commit()
/// renames to PATH. Without commit() it is removed, and what stood at PATH stays; but of a killed process, or of one
/// that could not write on, PATH.part stays with all whole rows. The next run of that PATH writes over it with its
/// first row, when it begins with the same header and its writer is gone; anything else of that name is left alone and
/// refused. What is no regular file is written into as the rows come. See OutputTarget.
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
