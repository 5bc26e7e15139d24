#include "lapservo/core/file_descriptor.h"

#include <cerrno>
#include <sys/file.h>
#include <unistd.h>

namespace lapservo::internal {

FileDescriptor::~FileDescriptor() {
  if (is_open()) ::close(number_);
}

int write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {
      return errno;
    }
  }
  return 0;
}

bool lock(const FileDescriptor& file) {
  return ::flock(file.number(), LOCK_EX | LOCK_NB) == 0;
}

}  // namespace lapservo::internal
