#include "lapservo/io/pictures/exif_orientation.h"

#include <cstddef>
#include <cstring>
#include <string_view>

#include "lapservo/io/pictures/jpeg_segments.h"
#include "lapservo/io/pictures/tiff_directory.h"
#include "lapservo/io/tables/numbers.h"

namespace lapservo::internal {
namespace {
using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t orientation_tag = 0x0112;

bool begins_with(Bytes bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

Bytes from(Bytes bytes, std::size_t at) {
  return at < bytes.size() ? bytes.subspan(at) : Bytes{};
}

// EXIF is a TIFF header too.
std::optional<std::size_t> of_exif(Bytes bytes) {
  constexpr std::string_view prefix("Exif\0\0", 6);
  return tiff_value(begins_with(bytes, prefix) ? from(bytes, prefix.size()) : bytes, orientation_tag);
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
  return tiff_value(picture, orientation_tag);
}

}  // namespace lapservo::internal
