#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace lapservo::internal {

/// A marker of a JPEG and what belongs to it: nothing for a restart, the beginning (D8) and the end (D9).
struct JpegSegment {
  std::uint8_t marker = 0;
  std::span<const std::uint8_t> content;
  std::size_t begin = 0, end = 0;  ///< places in the JPEG: of the marker, and behind the content
};

/// The first from a place on. Scans and garbage before it are stepped over, as decoders do. nullopt at the end, and
/// where the content is cut.
std::optional<JpegSegment> jpeg_segment(std::span<const std::uint8_t> jpeg, std::size_t from);

}  // namespace lapservo::internal
