#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace lapservo::internal {

/// A value of 8, 16 or 32 bits of a tag in a TIFF's first directory; nullopt where there is none, and for what is no
/// TIFF.
std::optional<std::size_t> tiff_value(std::span<const std::uint8_t> picture, std::size_t tag, std::size_t index = 0);

/// Whether the strips of a TIFF that is packed by DEFLATE hold all its rows. FFmpeg's decoder takes what memory holds
/// for those that are missing. True of other TIFFs, where they stay as they were, and of what is no TIFF.
bool tiff_has_its_rows(std::span<const std::uint8_t> picture);

}  // namespace lapservo::internal
