#include "lapservo/io/tiff_directory.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>
#include <zlib.h>

#include "lapservo/io/numbers.h"

namespace lapservo::internal {
namespace {
using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t entry_bytes = 12;  // tag, type, count and value

// Size, bits, compression, photometric interpretation, fill order, strips, samples, planes, options of fax compression,
// predictor, palette. Not which sample is alpha (338): the decoder takes the fourth, and refuses that tag.
constexpr std::array<std::size_t, 15> tags_of_pixels{256, 257, 258, 259, 262, 266, 273, 277,
                                                     278, 279, 284, 292, 293, 317, 320};

std::optional<Numbers> numbers_of(Bytes picture) {
  const auto begins_with = [&](std::string_view magic) {
    return picture.size() >= magic.size() && std::memcmp(picture.data(), magic.data(), magic.size()) == 0;
  };
  const bool big = begins_with(std::string_view("MM\0*", 4));
  if (!big && !begins_with(std::string_view("II*\0", 4))) return std::nullopt;
  return Numbers{picture, big};
}

struct Directory {
  std::size_t at, entries;  // of the number of entries, which the entries follow
  std::size_t entry(std::size_t i) const { return at + 2 + entry_bytes * i; }
};

Directory directory_of(const Numbers& numbers) {
  const std::size_t at = numbers.of(4, 4);
  return {at, numbers.of(at, 2)};
}

// Of an unsigned type; 0 of others.
std::size_t bytes_of_type(std::size_t type) {
  constexpr std::size_t is_byte = 1, is_short = 3, is_long = 4;
  return type == is_byte ? 1 : type == is_short ? 2 : type == is_long ? 4 : 0;
}

// All values of a tag; none of one that is missing or of another type than 8, 16 and 32 bits.
std::vector<std::size_t> values_of(const Numbers& numbers, std::size_t tag) {
  constexpr std::size_t in_entry = 4;
  const Directory directory = directory_of(numbers);
  for (std::size_t i = 0; i < directory.entries; ++i) {
    const std::size_t at = directory.entry(i), count = numbers.of(at + 4, 4);
    const std::size_t size = bytes_of_type(numbers.of(at + 2, 2));
    if (numbers.of(at, 2) != tag || size == 0) continue;
    const std::size_t from = count * size <= in_entry ? at + 8 : numbers.of(at + 8, 4);
    std::vector<std::size_t> values;
    for (std::size_t k = 0; k < count && from + k * size < numbers.bytes.size(); ++k)
      values.push_back(numbers.of(from + k * size, size));
    return values;
  }
  return {};
}

std::size_t value_of(const Numbers& numbers, std::size_t tag, std::size_t otherwise) {
  const std::vector<std::size_t> values = values_of(numbers, tag);
  return values.empty() ? otherwise : values.front();
}

// How many bytes come out of a packed strip, up to most.
std::size_t inflated_bytes(Bytes strip, std::size_t most) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return 0;
  std::array<std::uint8_t, 1 << 14> scratch{};
  stream.next_in = const_cast<std::uint8_t*>(strip.data());
  stream.avail_in = static_cast<uInt>(strip.size());
  std::size_t bytes = 0;
  for (int result = Z_OK; result == Z_OK && bytes < most; bytes += scratch.size() - stream.avail_out) {
    stream.next_out = scratch.data(), stream.avail_out = scratch.size();
    result = inflate(&stream, Z_NO_FLUSH);
  }
  inflateEnd(&stream);
  return std::min(bytes, most);
}

std::size_t bytes_of_rows(const Numbers& numbers) {
  constexpr std::size_t width = 256, height = 257, bits_a_sample = 258, samples_a_pixel = 277;
  const std::size_t bits = value_of(numbers, bits_a_sample, 1) * value_of(numbers, samples_a_pixel, 1);
  return value_of(numbers, height, 0) * ((value_of(numbers, width, 0) * bits + 7) / 8);
}

}  // namespace

bool tiff_has_its_rows(Bytes picture) {
  constexpr std::size_t compression = 259, offsets = 273, lengths = 279, deflate = 8, adobe_deflate = 32946;
  const auto numbers = numbers_of(picture);
  if (!numbers) return true;
  const std::size_t packed_by = value_of(*numbers, compression, 1);
  if (packed_by != deflate && packed_by != adobe_deflate) return true;
  const std::vector<std::size_t> from = values_of(*numbers, offsets), length = values_of(*numbers, lengths);
  constexpr std::size_t max_bytes = std::size_t{16384} * 16384 * 8;  // more than any picture that is read
  const std::size_t needed = bytes_of_rows(*numbers);
  if (needed > max_bytes) return false;
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < std::min(from.size(), length.size()) && bytes < needed; ++i) {
    if (from[i] > picture.size() || length[i] > picture.size() - from[i]) return false;
    bytes += inflated_bytes(picture.subspan(from[i], length[i]), needed - bytes);
  }
  return bytes >= needed;
}

std::optional<int> tiff_tag(Bytes picture, int tag) {
  const auto numbers = numbers_of(picture);
  const auto values = numbers ? values_of(*numbers, static_cast<std::size_t>(tag)) : std::vector<std::size_t>{};
  return values.empty() ? std::nullopt : std::optional(static_cast<int>(values.front()));
}

std::vector<std::uint8_t> tiff_of_pixels(Bytes picture) {
  std::vector<std::uint8_t> kept(picture.begin(), picture.end());
  const auto numbers = numbers_of(picture);
  if (!numbers) return kept;
  const Directory directory = directory_of(*numbers);
  if (directory.entry(directory.entries) + 4 > kept.size()) return kept;  // is truncated: whoever decodes it says so
  std::size_t count = 0;
  for (std::size_t i = 0; i < directory.entries; ++i) {
    const std::size_t from = directory.entry(i);
    if (std::find(tags_of_pixels.begin(), tags_of_pixels.end(), numbers->of(from, 2)) == tags_of_pixels.end()) continue;
    std::copy_n(picture.begin() + static_cast<std::ptrdiff_t>(from), entry_bytes,
                kept.begin() + static_cast<std::ptrdiff_t>(directory.entry(count++)));
  }
  std::fill_n(kept.begin() + static_cast<std::ptrdiff_t>(directory.entry(count)), 4, std::uint8_t{0});  // no next one
  kept[directory.at + (numbers->big_endian ? 0 : 1)] = static_cast<std::uint8_t>(count >> 8);
  kept[directory.at + (numbers->big_endian ? 1 : 0)] = static_cast<std::uint8_t>(count & 0xff);
  return kept;
}

}  // namespace lapservo::internal
