#include "lapservo/core/temporary_file.h"

#include <atomic>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <fcntl.h>
#include <string>
#include <sys/file.h>
#include <system_error>
#include <unistd.h>

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

constexpr std::string_view prefix = ".lapservo-";

// Whether the process in `.lapservo-PID-N` is there: it may not have come to locking its file yet.
bool writer_runs(std::string_view name) {
  int pid = 0;
  name.remove_prefix(prefix.size());
  const auto parsed = std::from_chars(name.data(), name.data() + name.size(), pid);
  return parsed.ec != std::errc() || pid <= 0 || ::kill(pid, 0) == 0 || errno != ESRCH;
}

void remove_leftovers(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(prefix) || writer_runs(name)) continue;
    const FileDescriptor file(::open(entry->path().c_str(), O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    struct stat status {};
    if (file.is_open() && ::fstat(file.number(), &status) == 0 && S_ISREG(status.st_mode) && lock(file))
      ::unlink(entry->path().c_str());
  }
}

}  // namespace

bool lock(const FileDescriptor& file) {
  return ::flock(file.number(), LOCK_EX | LOCK_NB) == 0;
}

TemporaryFile::TemporaryFile(const OutputTarget& target, Name name) : target_(target) {
  if (name == Name::if_needed && ::access("/proc/self/fd", X_OK) == 0)  // which is needed to name it in the end
    file_ = FileDescriptor(::open(target.folder().c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0666));
  if (!file_.is_open()) make_named();
}

TemporaryFile::~TemporaryFile() {
  if (!path_.empty()) ::unlink(path_.c_str());
}

void TemporaryFile::make_named() {
  static std::atomic<int> count = 0;
  remove_leftovers(target_.folder());
  for (int attempt = 0; attempt < 1000; ++attempt) {
    const std::string name = std::string(prefix) + std::to_string(::getpid()) + "-" + std::to_string(count++);
    const fs::path path = target_.folder() / (name + target_.name.extension().string());
    file_ = FileDescriptor(::open(path.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0666));
    if (file_.is_open()) {
      path_ = path;
      lock(file_);  // where locks aren't known, leftovers stay
      return;
    }
    if (errno != EEXIST) target_.fail(errno);
  }
  target_.fail(EEXIST);
}

void TemporaryFile::commit() {
  put_in_place(target_, file_.number(), path_);
  path_.clear();
}

}  // namespace lapservo::internal
