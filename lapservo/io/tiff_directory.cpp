#include "lapservo/io/tiff_directory.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string_view>

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

}  // namespace

std::optional<int> tiff_tag(Bytes picture, int tag) {
  const auto numbers = numbers_of(picture);
  if (!numbers) return std::nullopt;
  const Directory directory = directory_of(*numbers);
  for (std::size_t i = 0; i < directory.entries; ++i) {
    const std::size_t at = directory.entry(i), count = numbers->of(at + 4, 4);
    constexpr std::size_t fitting = 2;  // more values than these lie elsewhere
    if (numbers->of(at, 2) == static_cast<std::size_t>(tag))
      return static_cast<int>(numbers->of(count > fitting ? numbers->of(at + 8, 4) : at + 8, 2));
  }
  return std::nullopt;
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
