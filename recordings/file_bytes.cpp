#include "recordings/file_bytes.h"

#include <algorithm>
#include <fcntl.h>
#include <unistd.h>

#include "lapservo/core/error.h"

namespace lapservo::internal {

FileBytes::FileBytes(const std::string& path, const std::string& expected)
    : path_(path), file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  const off_t size = file_.is_open() ? ::lseek(file_.number(), 0, SEEK_END) : -1;
  if (size < 0) throw InputError(path, "can't be read, expected " + expected);
  if (size == 0) throw InputError(path, "is empty, expected " + expected);
  size_ = static_cast<std::uint64_t>(size);
}

bool FileBytes::read(std::uint64_t at, std::span<std::uint8_t> to) {
  while (!to.empty()) {
    const ssize_t count = ::pread(file_.number(), to.data(), to.size(), static_cast<off_t>(at));
    if (count <= 0) return false;
    at += static_cast<std::uint64_t>(count);
    to = to.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

std::optional<Bytes> FileBytes::bytes(std::uint64_t at, std::uint64_t count) {
  constexpr std::uint64_t together = 1 << 14;
  if (at > size_ || count > size_ - at) return std::nullopt;
  if (count > together) {
    Bytes bytes(count);
    return read(at, bytes) ? std::optional(std::move(bytes)) : std::nullopt;
  }
  if (at < window_at_ || at + count > window_at_ + window_.size()) {
    window_.resize(std::min(together, size_ - at));
    window_at_ = at;
    if (!read(at, window_)) return std::nullopt;
  }
  const auto begin = window_.begin() + static_cast<std::ptrdiff_t>(at - window_at_);
  return Bytes(begin, begin + static_cast<std::ptrdiff_t>(count));
}

}  // namespace lapservo::internal
