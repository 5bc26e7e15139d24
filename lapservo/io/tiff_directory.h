#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace lapservo::internal {

/// The first value, of 8, 16 or 32 bits, of a tag in a TIFF's first directory; nullopt without it, and for what is no
/// TIFF.
std::optional<int> tiff_tag(std::span<const std::uint8_t> picture, int tag);

/// Whether the strips of a TIFF that is packed by DEFLATE hold all its rows. FFmpeg's decoder takes what memory holds
/// for those that are missing. True of other TIFFs, whose decoders count, and of what is no TIFF.
bool tiff_has_its_rows(std::span<const std::uint8_t> picture);

/// The same picture with only the tags in its directory that its pixels are read by: FFmpeg's decoder, asked to be
/// strict, refuses those that it does not know. What is no TIFF stays as it is.
std::vector<std::uint8_t> tiff_of_pixels(std::span<const std::uint8_t> picture);

}  // namespace lapservo::internal
