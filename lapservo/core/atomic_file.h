#pragma once

#include <filesystem>
#include <sstream>
#include <string_view>

#include "lapservo/core/output_target.h"

namespace lapservo::internal {

/// A file that appears whole or not at all: gathered in memory and written by commit(). Without commit() nothing
/// changes. See OutputTarget.
/// Throws InputError when it can't be written, at construction where that shows by then, else in commit().
class AtomicFile {
 public:
  explicit AtomicFile(const std::filesystem::path& path) : target_(path) {}

  std::ostream& stream() { return text_; }
  void commit();

 private:
  OutputTarget target_;
  std::ostringstream text_;
};

/// Writes the whole text in that way.
void write_file(const std::filesystem::path& path, std::string_view text);

}  // namespace lapservo::internal
