#pragma once

#include <filesystem>
#include <optional>
#include <ostream>
#include <string_view>

#include "lapservo/core/output_target.h"
#include "lapservo/core/temporary_file.h"

namespace lapservo::internal {

/// A file that appears whole or not at all: written under no or a temporary name, put in its place by commit(). Without
/// commit() whatever stood at `path` before stays, and nothing else is left. What is no regular file is written into as
/// it comes. See OutputTarget.
/// Throws InputError when it can't be written, at construction, and when writing failed, in commit().
class AtomicFile {
 public:
  explicit AtomicFile(const std::filesystem::path& path);
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  std::ostream& stream() { return stream_; }
  void commit();

 private:
  OutputTarget target_;
  std::optional<TemporaryFile> temporary_;
  FileDescriptor opened_;  // of a stream
  DescriptorBuffer buffer_;
  std::ostream stream_;
};

/// Writes the whole text in that way.
void write_file(const std::filesystem::path& path, std::string_view text);

}  // namespace lapservo::internal
