#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace lapservo::internal {

/// A JPEG of one scan without the bytes that belong to no block, and with an end marker: cameras leave a few bytes
/// before restart markers or the end, or no end marker. nullopt where blocks are missing or were misread: where the
/// coefficients, written anew, are not what the data begin with between one restart and the next, or more than a few
/// bytes follow that.
std::optional<std::vector<std::uint8_t>> jpeg_without_strays(std::span<const std::uint8_t> jpeg);

}  // namespace lapservo::internal
