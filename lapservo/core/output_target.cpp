#include "lapservo/core/output_target.h"

#include <atomic>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <string_view>
#include <system_error>
#include <unistd.h>

#include "lapservo/core/error.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

// The number in /dev/fd/N and the like. Opening these again would begin at the start of a file that the shell or our
// own messages are writing to.
std::optional<int> own_descriptor(const fs::path& path) {
  const std::string text = path.string();
  if (text == "/dev/stdout") return STDOUT_FILENO;
  if (text == "/dev/stderr") return STDERR_FILENO;
  for (const std::string_view folder : {"/dev/fd/", "/proc/self/fd/"}) {
    int number = 0;
    if (!text.starts_with(folder)) continue;
    const char *digits = text.data() + folder.size(), *end = text.data() + text.size();
    if (const auto parsed = std::from_chars(digits, end, number); parsed.ec == std::errc() && parsed.ptr == end)
      return number;
  }
  return std::nullopt;
}

// The end of a chain of symbolic links, whether it exists or not.
fs::path link_target(fs::path path) {
  std::error_code error;
  for (int i = 0; i < 40 && !own_descriptor(path) && fs::is_symlink(path, error); ++i)
    path = path.parent_path() / fs::read_symlink(path, error);
  return path;
}

void refuse_kind(const fs::path& name, mode_t mode) {
  if (S_ISDIR(mode)) throw InputError(name.string(), "is a folder, expected a file to write");
  if (S_ISBLK(mode)) throw InputError(name.string(), "is a disk, expected a file to write");
  if (S_ISSOCK(mode)) throw InputError(name.string(), "is a socket, expected a file to write");
}

// The owner only where we may.
void keep_owner_and_mode(const OutputTarget& target, int descriptor) {
  [[maybe_unused]] const int refused = ::fchown(descriptor, target.existing->st_uid, target.existing->st_gid);
  if (::fchmod(descriptor, target.existing->st_mode & 0777) != 0) target.fail(errno);
}

// Flushed to the disk. Some special file systems know no such thing.
bool synced(int descriptor) {
  return ::fsync(descriptor) == 0 || errno == EINVAL || errno == EROFS || errno == ENOTSUP;
}

void sync_folder(const fs::path& folder) {
  const FileDescriptor opened(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened.is_open()) synced(opened.number());
}

// Gives a file without a name the target's, or one beside it where the target's is taken. 0 or errno.
int link_unnamed(const OutputTarget& target, int descriptor, fs::path& linked) {
  static std::atomic<int> count = 0;
  const std::string unnamed = "/proc/self/fd/" + std::to_string(descriptor);
  linked = target.file;
  for (int attempt = 0; attempt < 100; ++attempt) {
    if (::linkat(AT_FDCWD, unnamed.c_str(), AT_FDCWD, linked.c_str(), AT_SYMLINK_FOLLOW) == 0) return 0;
    if (errno != EEXIST) return errno;
    linked = target.folder() / (".lapservo-" + std::to_string(::getpid()) + "-link" + std::to_string(count++));
  }
  return EEXIST;
}

}  // namespace

fs::path OutputTarget::folder() const {
  return file.has_parent_path() ? file.parent_path() : fs::path(".");
}

void OutputTarget::fail(int error) const {
  throw InputError(name.string(), std::string("can't be written: ") + std::strerror(error ? error : EIO));
}

OutputTarget output_target(const fs::path& name) {
  OutputTarget target{name, link_target(name), {}, false};
  if (name.empty()) throw InputError("output", "has no name, expected a file to write");
  if (own_descriptor(target.file)) {
    target.is_stream = true;
    return target;
  }
  struct stat status {};
  // By the given name: the kernel refuses links of others in shared folders, we must not walk around it.
  if (::stat(name.c_str(), &status) != 0) {
    if (errno != ENOENT) target.fail(errno);
    if (!name.has_filename()) throw InputError(name.string(), "is a folder's name, expected a file to write");
    return target;
  }
  refuse_kind(name, status.st_mode);
  target.is_stream = !S_ISREG(status.st_mode);
  if (target.is_stream) return target;
  target.existing = status;
  const FileDescriptor allowed(::open(name.c_str(), O_WRONLY | O_CLOEXEC));
  if (!allowed.is_open()) target.fail(errno);
  return target;
}

FileDescriptor open_stream(const OutputTarget& target) {
  const auto own = own_descriptor(target.file);
  FileDescriptor opened(own ? ::fcntl(*own, F_DUPFD_CLOEXEC, 3)
                            : ::open(target.name.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY));
  if (!opened.is_open()) target.fail(errno);
  return opened;
}

void put_in_place(const OutputTarget& target, int descriptor, const fs::path& temporary) {
  if (target.existing) keep_owner_and_mode(target, descriptor);
  if (!synced(descriptor)) target.fail(errno);
  fs::path from = temporary;
  if (temporary.empty())
    if (const int error = link_unnamed(target, descriptor, from)) target.fail(error);
  if (from != target.file && ::rename(from.c_str(), target.file.c_str()) != 0) {
    const int error = errno;
    if (temporary.empty()) ::unlink(from.c_str());
    target.fail(error);
  }
  sync_folder(target.folder());
}

}  // namespace lapservo::internal
