#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "lapservo/io/tables/numbers.h"

namespace lapservo::internal {

/// The place of a PNG's first chunk, behind its signature.
inline constexpr std::size_t first_png_chunk = 8;

/// A length, a name, content and a checksum.
struct PngChunk {
  std::string_view name;
  std::span<const std::uint8_t> content;
  std::size_t end = 0;  ///< its place in the PNG
};

/// The chunk at a place of a PNG; nullopt where it is cut.
inline std::optional<PngChunk> png_chunk(std::span<const std::uint8_t> png, std::size_t at) {
  constexpr std::size_t before = 8, around = 12;
  if (at > png.size() || png.size() - at < around) return std::nullopt;
  const std::size_t length = Numbers{png, true}.of(at, 4);
  if (length > png.size() - at - around) return std::nullopt;
  return PngChunk{text_of(png).substr(at + 4, 4), png.subspan(at + before, length), at + around + length};
}

}  // namespace lapservo::internal
