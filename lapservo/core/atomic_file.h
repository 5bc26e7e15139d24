#pragma once

#include <filesystem>
#include <fstream>
#include <string>

namespace lapservo {

/// A file that appears whole or not at all: written under a temporary name beside it, renamed by commit(). Without
/// commit() the temporary file is removed and whatever stood at `path` before stays.
/// Throws InputError when the folder can't be written, at construction, and when writing failed, in commit().
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  std::ofstream& stream() { return stream_; }
  void commit();

 private:
  std::filesystem::path path_, temporary_;
  std::ofstream stream_;
};

/// Writes the whole text in that way.
void write_file(const std::filesystem::path& path, const std::string& text);

/// The temporary name beside `path` under which a result is written before it is renamed. Keeps the extension, which
/// writers of pictures and videos go by.
std::filesystem::path temporary_name(const std::filesystem::path& path);

}  // namespace lapservo
