#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace lapservo::internal {

/// The parts of which image files consist, found without decoding them.

/// Larger files are no images.
inline constexpr std::size_t max_picture_bytes = std::size_t{256} << 20;

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

enum class PictureFormat { none, png, jpeg, bmp, pnm, webp };
/// By the first bytes.
PictureFormat picture_format(std::span<const std::uint8_t> bytes);

/// A marker of a JPEG and what belongs to it: nothing for a restart, the beginning (D8) and the end (D9).
struct JpegSegment {
  std::uint8_t marker = 0;
  std::span<const std::uint8_t> content;
  std::size_t begin = 0, end = 0;  ///< places in the JPEG: of the marker, and behind the content
};
/// The first from a place on. Scans and garbage before it are stepped over, as decoders do. nullopt at the end, and
/// where the content is cut.
std::optional<JpegSegment> jpeg_segment(std::span<const std::uint8_t> jpeg, std::size_t from);

/// A name and content.
struct PictureChunk {
  std::string_view name;
  std::span<const std::uint8_t> content;
  std::size_t end = 0;  ///< its place in the file
};
inline constexpr std::size_t first_png_chunk = 8, first_webp_chunk = 12;
/// The chunk at a place of a PNG; nullopt where it is cut.
std::optional<PictureChunk> png_chunk(std::span<const std::uint8_t> png, std::size_t at);

/// How many images a file holds: one after the other, or as its own animation. 1 for a JPEG that says which of its
/// images is the first one (MPF, as phones append depth and brightness), and where that can't be seen.
std::size_t picture_count(std::span<const std::uint8_t> bytes);

/// Why a palette's indices, or channels of few bits, are not read, with the remedy; empty for other pixels.
std::string coarse_pixels(bool has_palette, int bits_a_channel);

/// The orientation (1 upright, 2 to 8 rotated or mirrored) that a JPEG, PNG or WebP sets for its viewers, by EXIF tag
/// 0x0112; nullopt without a valid one.
std::optional<std::size_t> exif_orientation(std::span<const std::uint8_t> picture);

}  // namespace lapservo::internal
