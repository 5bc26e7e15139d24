#include "lapservo/core/input_file.h"

#include <array>
#include <cerrno>
#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>

#include "lapservo/core/error.h"
#include "lapservo/core/file_descriptor.h"

namespace lapservo::internal {
namespace {

constexpr int patience_ms = 5000;

}  // namespace

std::string read_input(const std::filesystem::path& path, std::size_t max_bytes, std::string_view expected) {
  const auto fail = [&](const std::string& problem) {
    throw InputError(path.string(), problem + ", expected " + std::string(expected));
  };
  const auto fail_too_large = [&] { fail("is larger than " + std::to_string(max_bytes >> 20) + " MiB"); };
  // Not blocking: to open a pipe that nobody writes would take for ever.
  const FileDescriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat about {};
  std::error_code error;
  if (!file.is_open() || ::fstat(file.number(), &about) != 0)
    fail(errno == ENOENT && std::filesystem::is_symlink(path, error) ? "is a link to no file" : "can't be opened");
  if (S_ISDIR(about.st_mode)) fail("is a folder");
  if (S_ISREG(about.st_mode) && static_cast<std::size_t>(about.st_size) > max_bytes) fail_too_large();

  std::string text;
  std::array<char, 1 << 16> buffer{};
  while (true) {
    pollfd waited{file.number(), POLLIN, 0};
    const int ready = ::poll(&waited, 1, patience_ms);
    if (ready == 0) fail("gives nothing for " + std::to_string(patience_ms / 1000) + " seconds");
    if (ready < 0 && errno != EINTR) break;
    const ssize_t count = ::read(file.number(), buffer.data(), buffer.size());
    if (count == 0) break;
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (count < 0) fail("can't be read (" + std::system_category().message(errno) + ")");
    text.append(buffer.data(), static_cast<std::size_t>(count));
    if (text.size() > max_bytes) fail_too_large();
  }
  return text;
}

}  // namespace lapservo::internal
