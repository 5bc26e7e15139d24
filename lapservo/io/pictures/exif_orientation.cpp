#include "lapservo/io/pictures/exif_orientation.h"

#include <cstddef>
#include <string_view>

#include "lapservo/io/pictures/jpeg_segments.h"
#include "lapservo/io/tables/numbers.h"

namespace lapservo::internal {
namespace {
using namespace std::string_view_literals;
using Bytes = std::span<const std::uint8_t>;

Bytes from(Bytes bytes, std::size_t at) {
  return at < bytes.size() ? bytes.subspan(at) : Bytes{};
}

// A directory as TIFF has it, in either order of bytes. Its entries are a tag, a type, a count and a value.
std::optional<std::size_t> of_directory(Bytes bytes) {
  constexpr std::size_t entry_bytes = 12, orientation = 0x0112, is_short = 3;
  if (!text_of(bytes).starts_with("MM\0*"sv) && !text_of(bytes).starts_with("II*\0"sv)) return std::nullopt;
  const Numbers numbers{bytes, bytes[0] == 'M'};
  const std::size_t directory = numbers.of(4, 4);
  for (std::size_t i = 0; i < numbers.of(directory, 2); ++i) {
    const std::size_t at = directory + 2 + entry_bytes * i;
    if (numbers.of(at, 2) == orientation && numbers.of(at + 2, 2) == is_short) return numbers.of(at + 8, 2);
  }
  return std::nullopt;
}

std::optional<std::size_t> of_exif(Bytes bytes) {
  constexpr std::string_view prefix = "Exif\0\0"sv;
  return of_directory(text_of(bytes).starts_with(prefix) ? from(bytes, prefix.size()) : bytes);
}

// Segments up to the start of the scan.
std::optional<std::size_t> of_jpeg(Bytes bytes) {
  for (auto segment = jpeg_segment(bytes, 2); segment && segment->marker != 0xda;
       segment = jpeg_segment(bytes, segment->end))
    if (segment->marker == 0xe1 && text_of(segment->content).starts_with("Exif")) return of_exif(segment->content);
  return std::nullopt;
}

// Chunks of a name and a length: PNG's have 8 bytes before their content and 4 behind, RIFF's an even length.
std::optional<std::size_t> of_chunks(Bytes bytes, std::size_t first, bool png) {
  const Numbers numbers{bytes, png};
  for (std::size_t at = first; at + 8 <= bytes.size();) {
    const std::size_t length = numbers.of(png ? at : at + 4, 4);
    if (text_of(from(bytes, png ? at + 4 : at)).starts_with(png ? "eXIf" : "EXIF")) return of_exif(from(bytes, at + 8));
    at += 8 + length + (png ? 4 : length % 2);
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::size_t> exif_orientation(Bytes picture) {
  if (text_of(picture).starts_with("\xff\xd8")) return of_jpeg(picture);
  if (text_of(picture).starts_with("\x89PNG")) return of_chunks(picture, 8, true);
  if (text_of(picture).starts_with("RIFF")) return of_chunks(picture, 12, false);
  return std::nullopt;
}

}  // namespace lapservo::internal
