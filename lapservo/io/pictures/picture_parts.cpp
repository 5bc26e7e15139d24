#include "lapservo/io/pictures/picture_parts.h"

#include <algorithm>
#include <charconv>

namespace lapservo::internal {
namespace {
using Bytes = std::span<const std::uint8_t>;
using namespace std::string_view_literals;

bool stands_alone(std::uint8_t marker) {
  return marker == 0x01 || (marker >= 0xd0 && marker <= 0xd9);
}

// The last one of a WebP may be cut.
std::optional<PictureChunk> webp_chunk(Bytes webp, std::size_t at) {
  constexpr std::size_t before = 8;
  if (at > webp.size() || webp.size() - at < before) return std::nullopt;
  const std::size_t length = Numbers{webp, false}.of(at + 4, 4), left = webp.size() - at - before;
  return PictureChunk{text_of(webp).substr(at, 4), webp.subspan(at + before, std::min(length, left)),
                      at + before + length + length % 2};
}

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
  const std::size_t end = 8 + Numbers{bytes, false}.of(4, 4);
  const Bytes webp = bytes.first(std::min(end, bytes.size()));
  std::size_t frames = 0;
  for (auto chunk = webp_chunk(webp, first_webp_chunk); chunk; chunk = webp_chunk(webp, chunk->end))
    frames += chunk->name == "ANMF" ? 1 : 0;
  return {std::max<std::size_t>(frames, 1), end};
}

First first_picture(Bytes bytes, PictureFormat format) {
  switch (format) {
    case PictureFormat::png:
      return first_png(bytes);
    case PictureFormat::jpeg:
      return first_jpeg(bytes);
    case PictureFormat::pnm:
      return first_pnm(bytes);
    case PictureFormat::webp:
      return first_webp(bytes);
    case PictureFormat::bmp:
      return {1, std::max<std::size_t>(Numbers{bytes, false}.of(2, 4), 2)};
    case PictureFormat::none:
      break;
  }
  return {};
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

// An image's EXIF; empty where it has none. That of a JPEG stands before its scan.
Bytes exif_in(Bytes picture) {
  const PictureFormat format = picture_format(picture);
  if (format == PictureFormat::jpeg)
    for (auto segment = jpeg_segment(picture, 2); segment && segment->marker != 0xda;
         segment = jpeg_segment(picture, segment->end))
      if (segment->marker == 0xe1 && text_of(segment->content).starts_with("Exif")) return segment->content;
  if (format == PictureFormat::png)
    for (auto chunk = png_chunk(picture, first_png_chunk); chunk; chunk = png_chunk(picture, chunk->end))
      if (chunk->name == "eXIf") return chunk->content;
  if (format == PictureFormat::webp)
    for (auto chunk = webp_chunk(picture, first_webp_chunk); chunk; chunk = webp_chunk(picture, chunk->end))
      if (chunk->name == "EXIF") return chunk->content;
  return {};
}

}  // namespace

PictureFormat picture_format(Bytes bytes) {
  const std::string_view text = text_of(bytes);
  if (text.starts_with("\x89PNG\r\n\x1a\n")) return PictureFormat::png;
  if (text.starts_with("\xff\xd8")) return PictureFormat::jpeg;
  if (text.starts_with("BM")) return PictureFormat::bmp;
  if (text.size() >= 2 && text[0] == 'P' && text[1] >= '1' && text[1] <= '6') return PictureFormat::pnm;
  return text.starts_with("RIFF") ? PictureFormat::webp : PictureFormat::none;
}

std::optional<JpegSegment> jpeg_segment(Bytes jpeg, std::size_t from) {
  for (std::size_t at = from; at + 2 <= jpeg.size(); ++at) {
    // Within scans 00 follows an FF that is data.
    if (jpeg[at] != 0xff || jpeg[at + 1] == 0 || jpeg[at + 1] == 0xff) continue;
    const std::size_t content = at + (stands_alone(jpeg[at + 1]) ? 2 : 4);
    const std::size_t length = Numbers{jpeg, true}.of(at + 2, 2);
    const std::size_t end = content == at + 2 ? content : at + 2 + std::max<std::size_t>(length, 2);
    if (end > jpeg.size()) return std::nullopt;
    return JpegSegment{jpeg[at + 1], jpeg.subspan(content, end - content), at, end};
  }
  return std::nullopt;
}

std::optional<PictureChunk> png_chunk(Bytes png, std::size_t at) {
  constexpr std::size_t before = 8, around = 12;  // length and name; and a checksum
  if (at > png.size() || png.size() - at < around) return std::nullopt;
  const std::size_t length = Numbers{png, true}.of(at, 4);
  if (length > png.size() - at - around) return std::nullopt;
  return PictureChunk{text_of(png).substr(at + 4, 4), png.subspan(at + before, length), at + around + length};
}

std::size_t picture_count(Bytes bytes) {
  const PictureFormat format = picture_format(bytes);
  std::size_t count = 0;
  while (format != PictureFormat::none && picture_format(bytes) == format) {
    const First first = first_picture(bytes, format);
    count += std::max<std::size_t>(first.pictures, 1);
    const std::size_t next = text_of(bytes).find_first_not_of("\0\r\n\t "sv, std::min(first.end, bytes.size()));
    bytes = bytes.subspan(std::min(next, bytes.size()));
  }
  return std::max<std::size_t>(count, 1);
}

// The error of psi on a rendered swing was 0.93 of its sigma in RGB565, 1.6 in RGB332 and 6.7 in palettes.
std::string coarse_pixels(bool has_palette, int bits_a_channel) {
  constexpr int least_bits = 5;
  if (!has_palette && bits_a_channel >= least_bits) return "";
  return (has_palette ? "has a palette" : "has " + std::to_string(bits_a_channel) + " bits a channel") +
         std::string(
             ", expected the camera's colours, of 5 bits a channel or more: record or export it again in true "
             "colour, as a conversion does not restore them");
}

std::optional<std::size_t> exif_orientation(Bytes picture) {
  constexpr std::string_view prefix = "Exif\0\0"sv;
  const Bytes exif = exif_in(picture);
  return of_directory(exif.subspan(text_of(exif).starts_with(prefix) ? prefix.size() : 0));
}

}  // namespace lapservo::internal
