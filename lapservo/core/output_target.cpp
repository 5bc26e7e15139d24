#include "lapservo/core/output_target.h"

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <string>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

// Opening it again would begin at the start of a file that the shell or our own messages are writing to, and replacing
// it would lose what it holds.
int own_descriptor_of(const struct stat& status) {
  for (const int own : {STDOUT_FILENO, STDERR_FILENO}) {
    struct stat ours {};
    if (::fstat(own, &ours) == 0 && ours.st_dev == status.st_dev && ours.st_ino == status.st_ino) return own;
  }
  return -1;
}

[[noreturn]] void refuse(const fs::path& name, const char* kind) {
  throw InputError(name.string(), std::string(kind) + ", expected a file to write");
}

// The owner only where we may.
bool keep_owner_and_mode(const OutputTarget& target, int descriptor) {
  [[maybe_unused]] const int refused = ::fchown(descriptor, target.existing->st_uid, target.existing->st_gid);
  return ::fchmod(descriptor, target.existing->st_mode & 0777) == 0;
}

bool sync(int descriptor) {
  return ::fsync(descriptor) == 0 || errno == EINVAL || errno == ENOTSUP;  // some file systems can't
}

}  // namespace

OutputTarget::OutputTarget(const fs::path& given) : name(given) {
  if (name.empty()) throw InputError("output", "has no name, expected a file to write");
  struct stat status {};
  if (::stat(name.c_str(), &status) == 0) {
    take(status);
  } else if (errno == ENOENT) {
    if (!name.has_filename()) refuse(name, "is a folder's name");
    std::error_code error;
    if (fs::is_symlink(name, error)) refuse(name, "is a link to no file");
    file = name;
  } else {
    fail(errno);
  }
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  if (!is_stream() && ::access(folder.c_str(), W_OK | X_OK) != 0) fail(errno);
}

void OutputTarget::take(const struct stat& status) {
  if (S_ISDIR(status.st_mode)) refuse(name, "is a folder");
  if (S_ISBLK(status.st_mode)) refuse(name, "is a disk");
  if (::access(name.c_str(), W_OK) != 0) fail(errno);
  own_descriptor = own_descriptor_of(status);
  if (own_descriptor >= 0 || !S_ISREG(status.st_mode)) return;
  existing = status;
  std::error_code error;
  file = fs::canonical(name, error);
  if (error) fail(error.value());
}

void OutputTarget::fail(int error, const std::string& kept) const {
  throw InputError(name.string(), std::string("can't be written: ") + std::strerror(error) + kept);
}

void OutputTarget::fail_writing(int error, const std::string& kept) const {
  throw InputError(name.string(), std::string("could not be written to its end: ") + std::strerror(error) + kept);
}

FileDescriptor open_stream(const OutputTarget& target) {
  FileDescriptor opened(target.own_descriptor >= 0 ? ::fcntl(target.own_descriptor, F_DUPFD_CLOEXEC, 3)
                                                   : ::open(target.name.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY));
  if (!opened.is_open()) target.fail(errno);
  return opened;
}

void put_in_place(const OutputTarget& target, int descriptor, fs::path& temporary) {
  const fs::path complete = std::exchange(temporary, {});
  if ((target.existing && !keep_owner_and_mode(target, descriptor)) || !sync(descriptor) ||
      ::rename(complete.c_str(), target.file.c_str()) != 0)
    target.fail(errno, "; what was to be there is in " + complete.string());
}

TemporaryFile::TemporaryFile(OutputTarget target) : target_(std::move(target)) {
  static std::atomic<int> count = 0;
  do {  // a killed process may have had our number, and left a file
    path_ = target_.file.string() + "." + std::to_string(::getpid()) + "-" + std::to_string(count++) + ".part";
    file_ = FileDescriptor(::open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666));
  } while (!file_.is_open() && errno == EEXIST);
  if (!file_.is_open()) target_.fail(errno);
}

TemporaryFile::~TemporaryFile() {
  if (!path_.empty()) ::unlink(path_.c_str());
}

void TemporaryFile::write(std::string_view bytes) {
  if (const int error = write_all(file_.number(), bytes)) target_.fail_writing(error);
}

void TemporaryFile::commit() {
  put_in_place(target_, file_.number(), path_);
}

}  // namespace lapservo::internal
