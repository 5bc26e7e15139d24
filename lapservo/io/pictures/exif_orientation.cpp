#include "lapservo/io/pictures/exif_orientation.h"

#include <cstddef>
#include <cstring>
#include <string_view>

#include "lapservo/io/pictures/jpeg_segments.h"
#include "lapservo/io/tables/numbers.h"

namespace lapservo::internal {
namespace {
using Bytes = std::span<const std::uint8_t>;

bool begins_with(Bytes bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

Bytes from(Bytes bytes, std::size_t at) {
  return at < bytes.size() ? bytes.subspan(at) : Bytes{};
}

// A directory as TIFF has it, in either order of bytes. Its entries are a tag, a type, a count and a value.
std::optional<std::size_t> of_directory(Bytes bytes) {
  constexpr std::size_t entry_bytes = 12, orientation = 0x0112, is_short = 3;
  if (!begins_with(bytes, {"MM\0*", 4}) && !begins_with(bytes, {"II*\0", 4})) return std::nullopt;
  const Numbers numbers{bytes, bytes[0] == 'M'};
  const std::size_t directory = numbers.of(4, 4);
  for (std::size_t i = 0; i < numbers.of(directory, 2); ++i) {
    const std::size_t at = directory + 2 + entry_bytes * i;
    if (numbers.of(at, 2) == orientation && numbers.of(at + 2, 2) == is_short) return numbers.of(at + 8, 2);
  }
  return std::nullopt;
}

std::optional<std::size_t> of_exif(Bytes bytes) {
  constexpr std::string_view prefix("Exif\0\0", 6);
  return of_directory(begins_with(bytes, prefix) ? from(bytes, prefix.size()) : bytes);
}

// Segments up to the start of the scan.
std::optional<std::size_t> of_jpeg(Bytes bytes) {
  for (auto segment = jpeg_segment(bytes, 2); segment && segment->marker != 0xda;
       segment = jpeg_segment(bytes, segment->end))
    if (segment->marker == 0xe1 && begins_with(segment->content, "Exif")) return of_exif(segment->content);
  return std::nullopt;
}

// Chunks of a name and a length: PNG's have 8 bytes before their content and 4 behind, RIFF's an even length.
std::optional<std::size_t> of_chunks(Bytes bytes, std::size_t first, bool png) {
  const Numbers numbers{bytes, png};
  for (std::size_t at = first; at + 8 <= bytes.size();) {
    const std::size_t length = numbers.of(png ? at : at + 4, 4);
    if (begins_with(from(bytes, png ? at + 4 : at), png ? "eXIf" : "EXIF")) return of_exif(from(bytes, at + 8));
    at += 8 + length + (png ? 4 : length % 2);
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::size_t> exif_orientation(Bytes picture) {
  if (begins_with(picture, "\xff\xd8")) return of_jpeg(picture);
  if (begins_with(picture, "\x89PNG")) return of_chunks(picture, 8, true);
  if (begins_with(picture, "RIFF")) return of_chunks(picture, 12, false);
  return std::nullopt;
}

}  // namespace lapservo::internal
