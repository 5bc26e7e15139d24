#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace lapservo::internal {

/// The orientation (1 upright, 2 to 8 rotated or mirrored) that a JPEG, PNG or WebP sets for its viewers, by EXIF tag
/// 0x0112; nullopt without a valid one.
std::optional<std::size_t> exif_orientation(std::span<const std::uint8_t> picture);

}  // namespace lapservo::internal
