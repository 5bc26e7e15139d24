#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "recordings/file_bytes.h"

namespace lapservo::internal {

/// The content of a bag's chunk that was compressed by "bz2", "lz4" or "zstd" and has `size` bytes; fewer where what is
/// compressed ends early. nullopt for what is damaged, larger, or compressed otherwise.
std::optional<Bytes> inflated(const std::string& compression, ByteView from, std::size_t size);

/// Larger chunks are refused, so that a small file can't fill the memory.
inline constexpr std::size_t most_of_a_chunk = std::size_t{256} << 20;

}  // namespace lapservo::internal
