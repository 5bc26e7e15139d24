#include "lapservo/io/pictures/tiff_directory.h"

#include <cstring>
#include <vector>
#include <zlib.h>

#include "lapservo/io/tables/numbers.h"

namespace lapservo::internal {
namespace {
using Bytes = std::span<const std::uint8_t>;

// Size of an unsigned type; 0 for others.
std::size_t bytes_of_type(std::size_t type) {
  constexpr std::size_t is_byte = 1, is_short = 3, is_long = 4;
  return type == is_byte ? 1 : type == is_short ? 2 : type == is_long ? 4 : 0;
}

bool is_tiff(Bytes picture) {
  return picture.size() >= 4 &&
         (std::memcmp(picture.data(), "MM\0*", 4) == 0 || std::memcmp(picture.data(), "II*\0", 4) == 0);
}

std::size_t bytes_of_rows(Bytes picture) {
  constexpr std::size_t width = 256, height = 257, bits_a_sample = 258, samples_a_pixel = 277;
  const std::size_t bits =
      tiff_value(picture, bits_a_sample).value_or(1) * tiff_value(picture, samples_a_pixel).value_or(1);
  return tiff_value(picture, height).value_or(0) * ((tiff_value(picture, width).value_or(0) * bits + 7) / 8);
}

}  // namespace

std::optional<std::size_t> tiff_value(Bytes picture, std::size_t tag, std::size_t index) {
  constexpr std::size_t entry_bytes = 12, in_entry = 4;  // tag, type, count and value or its place
  if (!is_tiff(picture)) return std::nullopt;
  const Numbers numbers{picture, picture[0] == 'M'};
  const std::size_t directory = numbers.of(4, 4);
  for (std::size_t i = 0; i < numbers.of(directory, 2); ++i) {
    const std::size_t at = directory + 2 + entry_bytes * i, count = numbers.of(at + 4, 4);
    const std::size_t size = bytes_of_type(numbers.of(at + 2, 2));
    if (numbers.of(at, 2) != tag || size == 0) continue;
    const std::size_t from = count * size <= in_entry ? at + 8 : numbers.of(at + 8, 4);
    return index < count ? std::optional(numbers.of(from + index * size, size)) : std::nullopt;
  }
  return std::nullopt;
}

bool tiff_has_its_rows(Bytes picture) {
  constexpr std::size_t compression = 259, offsets = 273, lengths = 279, deflate = 8, adobe_deflate = 32946;
  constexpr std::size_t most_packed = 1032;  // by DEFLATE, bytes in one
  const auto packed_by = tiff_value(picture, compression);
  if (packed_by != deflate && packed_by != adobe_deflate) return true;
  const std::size_t needed = bytes_of_rows(picture);
  if (needed / most_packed > picture.size()) return false;
  std::vector<std::uint8_t> rows(needed);
  std::size_t found = 0;
  for (std::size_t i = 0; found < needed; ++i) {
    const auto from = tiff_value(picture, offsets, i), length = tiff_value(picture, lengths, i);
    if (!from || !length || *from > picture.size() || *length > picture.size() - *from) return false;
    uLongf room = needed - found;
    uncompress(rows.data() + found, &room, picture.data() + *from, *length);
    found += room;
  }
  return true;
}

}  // namespace lapservo::internal
