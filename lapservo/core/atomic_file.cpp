#include "lapservo/core/atomic_file.h"

#include <cerrno>
#include <cstring>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "lapservo/core/error.h"

namespace lapservo {
namespace fs = std::filesystem;

fs::path temporary_name(const fs::path& path) {
  const std::string name =
      "." + path.stem().string() + ".part" + std::to_string(::getpid()) + path.extension().string();
  return path.parent_path() / name;
}

AtomicFile::AtomicFile(fs::path path) : path_(std::move(path)), temporary_(temporary_name(path_)) {
  std::error_code ignored;
  if (fs::is_directory(path_, ignored)) throw InputError(path_.string(), "is a folder, expected a file to write");
  errno = 0;
  stream_.open(temporary_, std::ios::binary | std::ios::trunc);
  if (!stream_)
    throw InputError(path_.string(), std::string("can't be written: ") + std::strerror(errno ? errno : EIO));
}

AtomicFile::~AtomicFile() {
  if (temporary_.empty()) return;
  stream_.close();
  std::error_code ignored;
  fs::remove(temporary_, ignored);
}

void AtomicFile::commit() {
  stream_.close();
  if (!stream_) throw InputError(path_.string(), "could not be written to its end (is the disk full?)");
  std::error_code error;
  fs::rename(temporary_, path_, error);
  if (error) throw InputError(path_.string(), "can't be written: " + error.message());
  temporary_.clear();
}

void write_file(const std::filesystem::path& path, const std::string& text) {
  AtomicFile file(path);
  file.stream() << text;
  file.commit();
}

}  // namespace lapservo
