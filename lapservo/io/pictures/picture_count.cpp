#include "lapservo/io/pictures/picture_count.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>

#include "lapservo/io/pictures/jpeg_segments.h"
#include "lapservo/io/pictures/png_chunk.h"
#include "lapservo/io/tables/numbers.h"

namespace lapservo::internal {
namespace {
using Bytes = std::span<const std::uint8_t>;
using namespace std::string_view_literals;

constexpr std::size_t unknown = std::size_t(-1);

// Images in the first file of `bytes`, and where that ends.
struct First {
  std::size_t pictures = 1, end = unknown;
};

First first_png(Bytes bytes) {
  First first;
  for (auto chunk = png_chunk(bytes, first_png_chunk); chunk; chunk = png_chunk(bytes, chunk->end)) {
    if (chunk->name == "acTL") first.pictures = Numbers{chunk->content, true}.of(0, 4);
    if (chunk->name == "IEND") return {first.pictures, chunk->end};
  }
  return first;
}

First first_jpeg(Bytes bytes) {
  for (auto segment = jpeg_segment(bytes, 2); segment; segment = jpeg_segment(bytes, segment->end)) {
    if (segment->marker == 0xd9) return {1, segment->end};
    if (segment->marker == 0xe2 && text_of(segment->content).starts_with("MPF\0"sv)) return {};
  }
  return {};
}

// The next number of a PNM's header, behind blanks and comments; 0 where there is none.
std::size_t pnm_number(std::string_view text, std::size_t& at) {
  constexpr std::string_view blanks = " \t\r\n\v\f";
  at = std::min(text.find_first_not_of(blanks, at), text.size());
  while (at < text.size() && text[at] == '#') {
    at = std::min(text.find('\n', at), text.size());
    at = std::min(text.find_first_not_of(blanks, at), text.size());
  }
  std::size_t number = 0;
  at = static_cast<std::size_t>(std::from_chars(text.data() + at, text.data() + text.size(), number).ptr - text.data());
  return number;
}

// P1 to P3 are numbers as text, among which a P begins the next image; P4 to P6 have as many bytes as the header
// says.
First first_pnm(Bytes bytes) {
  const std::string_view text = text_of(bytes);
  const char kind = text[1];
  if (kind <= '3') return {1, text.find('P', 2)};
  std::size_t at = 2;
  const std::size_t width = pnm_number(text, at), height = pnm_number(text, at);
  const std::size_t bits = kind == '4' ? 1 : 8 * (pnm_number(text, at) > 255 ? 2 : 1) * (kind == '6' ? 3 : 1);
  constexpr std::size_t most = 1 << 20;
  if (width == 0 || height == 0 || width > most || height > most) return {};
  return {1, at + 1 + height * ((width * bits + 7) / 8)};
}

First first_webp(Bytes bytes) {
  const Numbers numbers{bytes, false};
  const std::size_t end = 8 + numbers.of(4, 4);
  std::size_t frames = 0;
  for (std::size_t at = 12; at + 8 <= std::min(end, bytes.size());) {
    frames += text_of(bytes).substr(at, 4) == "ANMF" ? 1 : 0;
    at += 8 + (numbers.of(at + 4, 4) + 1) / 2 * 2;
  }
  return {std::max<std::size_t>(frames, 1), end};
}

First first_bmp(Bytes bytes) {
  return {1, std::max<std::size_t>(Numbers{bytes, false}.of(2, 4), 2)};
}

struct Format {
  std::string_view magic, kinds;  // and one of these letters behind it, where there are some
  First (*first)(Bytes);
};
constexpr std::array formats{Format{"\x89PNG", "", first_png}, Format{"\xff\xd8", "", first_jpeg},
                             Format{"P", "123456", first_pnm}, Format{"RIFF", "", first_webp},
                             Format{"BM", "", first_bmp}};

bool begins(Bytes bytes, const Format& format) {
  const std::string_view text = text_of(bytes), kind = text.substr(std::min(format.magic.size(), text.size()), 1);
  return text.starts_with(format.magic) &&
         (format.kinds.empty() || (!kind.empty() && format.kinds.find(kind) != kind.npos));
}

}  // namespace

std::size_t picture_count(Bytes bytes) {
  const auto* const format =
      std::find_if(formats.begin(), formats.end(), [&](const Format& one) { return begins(bytes, one); });
  std::size_t count = 0;
  while (format != formats.end() && begins(bytes, *format)) {
    const First first = format->first(bytes);
    count += std::max<std::size_t>(first.pictures, 1);
    const std::size_t next = text_of(bytes).find_first_not_of("\0\r\n\t "sv, std::min(first.end, bytes.size()));
    bytes = bytes.subspan(std::min(next, bytes.size()));
  }
  return std::max<std::size_t>(count, 1);
}

}  // namespace lapservo::internal
