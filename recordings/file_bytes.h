#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "lapservo/core/file_descriptor.h"

namespace lapservo::internal {

static_assert(std::endian::native == std::endian::little, "bags are little-endian, and so is what is copied");

using Bytes = std::vector<std::uint8_t>;
using ByteView = std::span<const std::uint8_t>;

/// The first of the bytes, which are shortened by it; nullopt where there are fewer, and of all that is taken then.
template <typename T>
std::optional<T> taken(ByteView& from) {
  if (from.size() < sizeof(T)) return from = {}, std::nullopt;
  T value;
  std::memcpy(&value, from.data(), sizeof value);
  from = from.subspan(sizeof value);
  return value;
}
/// The same for a block behind its length.
template <typename Length = std::uint32_t>
std::optional<ByteView> block_taken(ByteView& from) {
  const auto size = taken<Length>(from);
  if (!size || *size > from.size()) return from = {}, std::nullopt;
  const ByteView block = from.first(*size);
  from = from.subspan(*size);
  return block;
}

/// A file's bytes by their place. Small pieces that follow one another are read together.
class FileBytes {
 public:
  /// Throws InputError for a file that can't be read or is empty. `expected`: what it shall be, for that message.
  FileBytes(const std::string& path, const std::string& expected);

  const std::string& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  /// nullopt where the file ends earlier.
  std::optional<Bytes> bytes(std::uint64_t at, std::uint64_t count);

 private:
  bool read(std::uint64_t at, std::span<std::uint8_t> to);

  std::string path_;
  FileDescriptor file_;
  std::uint64_t size_ = 0, window_at_ = 0;
  Bytes window_;
};

}  // namespace lapservo::internal
