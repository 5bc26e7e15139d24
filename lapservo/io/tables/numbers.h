#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace lapservo::internal {

inline std::string_view text_of(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// Unsigned numbers at a place of bytes of either order; 0 beyond their end.
struct Numbers {
  std::span<const std::uint8_t> bytes;
  bool big_endian;

  std::size_t of(std::size_t at, std::size_t count) const {
    if (at > bytes.size() || bytes.size() - at < count) return 0;
    std::size_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value = value << 8 | bytes[at + (big_endian ? i : count - 1 - i)];
    return value;
  }
};

}  // namespace lapservo::internal
