#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace lapservo::internal {

/// The content of a ROS 1 bag's chunk of `size` bytes that was compressed by "none", "bz2" or "lz4"; nullopt for what
/// is damaged, of another size, larger than 256 MiB or compressed otherwise.
std::optional<std::vector<std::uint8_t>> uncompressed_chunk(const std::string& compression,
                                                            std::vector<std::uint8_t> bytes, std::uint32_t size);

}  // namespace lapservo::internal
