#include "lapservo/io/pictures/png_picture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <png.h>
#include <string_view>
#include <vector>
#include <zlib.h>

#include "lapservo/io/pictures/picture_parts.h"

namespace lapservo::internal {
namespace {

struct Source {
  std::span<const std::uint8_t> left;
  std::string complaint;

  void keep(const char* text) {
    if (complaint.empty()) complaint = text;
  }
};

void on_png_error(png_structp png, png_const_charp text) {
  static_cast<Source*>(png_get_error_ptr(png))->keep(text);
  png_longjmp(png, 1);
}

// Others are about what is not used: profiles, times, texts.
void on_warning(png_structp png, png_const_charp text) {
  if (std::string_view(text).starts_with("IDAT")) static_cast<Source*>(png_get_error_ptr(png))->keep(text);
}

void read_bytes(png_structp png, png_bytep out, std::size_t count) {
  Source& source = *static_cast<Source*>(png_get_io_ptr(png));
  if (count > source.left.size()) png_error(png, "ends too early");
  std::copy_n(source.left.begin(), count, out);
  source.left = source.left.subspan(count);
}

// The content of a chunk before the data; empty where there is none.
std::span<const std::uint8_t> chunk_in(std::span<const std::uint8_t> png, std::string_view wanted) {
  for (auto chunk = png_chunk(png, first_png_chunk); chunk && chunk->name != "IDAT"; chunk = png_chunk(png, chunk->end))
    if (chunk->name == wanted) return chunk->content;
  return {};
}

void convert_to_bgr(png_structp png, bool deep) {
  png_set_crc_action(png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
  png_set_gray_to_rgb(png);
  if (deep) {
    png_set_expand_16(png);
    if constexpr (std::endian::native == std::endian::little) png_set_swap(png);
  } else {
    png_set_scale_16(png);
  }
  png_set_strip_alpha(png);
  png_set_bgr(png);
  png_set_interlace_handling(png);
}

// The library leaves by longjmp: nothing here may have a destructor.
void read_rows(png_structp png, png_infop info, cv::Mat& image, std::vector<png_bytep>& rows, bool deep) {
  if (setjmp(png_jmpbuf(png)) != 0) return;
  png_read_info(png, info);
  convert_to_bgr(png, deep);
  png_read_update_info(png, info);
  if (png_get_rowbytes(png, info) != std::size_t{deep ? 6U : 3U} * png_get_image_width(png, info))
    png_error(png, "is of no kind known");
  image.create(static_cast<int>(png_get_image_height(png, info)), static_cast<int>(png_get_image_width(png, info)),
               deep ? CV_16UC3 : CV_8UC3);
  image.setTo(0);
  rows.resize(static_cast<std::size_t>(image.rows));
  for (int v = 0; v < image.rows; ++v) rows[static_cast<std::size_t>(v)] = image.ptr(v);
  png_read_image(png, rows.data());
  png_read_end(png, info);
}

void on_png_encoding_error(png_structp png, png_const_charp) {
  png_longjmp(png, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

void append(png_structp png, png_bytep data, std::size_t count) {
  auto& bytes = *static_cast<std::vector<std::uint8_t>*>(png_get_io_ptr(png));
  bytes.insert(bytes.end(), data, data + count);
}

void flush_nothing(png_structp) {}

int colour_type_of(int channels) {
  return channels == 1 ? PNG_COLOR_TYPE_GRAY : channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGB_ALPHA;
}

// A frame with noise takes much less time than zlib's own way, and is hardly larger: differences to the left,
// and of what repeats only runs.
void be_fast(png_structp png) {
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_compression_level(png, Z_BEST_SPEED);
  png_set_compression_strategy(png, Z_RLE);
}

// As read_rows().
bool write_picture(png_structp png, png_infop info, const cv::Mat& image) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  const bool deep = image.depth() == CV_16U;
  be_fast(png);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.cols), static_cast<png_uint_32>(image.rows), deep ? 16 : 8,
               colour_type_of(image.channels()), PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  png_set_bgr(png);
  if (deep && std::endian::native == std::endian::little) png_set_swap(png);
  for (int v = 0; v < image.rows; ++v) png_write_row(png, const_cast<png_bytep>(image.ptr(v)));
  png_write_end(png, info);
  return true;
}

}  // namespace

// A profile or sRGB overrules gAMA. Some 1/2.2 stands for sRGB everywhere.
std::optional<Transfer> png_transfer(std::span<const std::uint8_t> png) {
  if (const auto code = chunk_in(png, "cICP"); code.size() == 4) return transfer_of_code(code[1]);
  const auto gamma = chunk_in(png, "gAMA");
  if (gamma.size() != 4 || !chunk_in(png, "iCCP").empty() || !chunk_in(png, "sRGB").empty()) return std::nullopt;
  const double exponent = static_cast<double>(Numbers{gamma, true}.of(0, 4)) * 1e-5;
  constexpr double usual = 1 / 2.2, tolerance = 0.03, least = 0.1, most = 10;
  if (!(exponent >= least && exponent <= most) || std::abs(exponent - usual) <= tolerance) return std::nullopt;
  return Transfer{Transfer::Kind::power, 1 / exponent};
}

DecodedPicture decode_png(std::span<const std::uint8_t> bytes) {
  DecodedPicture picture;
  const Numbers header{bytes, true};
  picture.coarse = coarse_pixels(header.of(25, 1) == PNG_COLOR_TYPE_PALETTE, static_cast<int>(header.of(24, 1)));
  if (!picture.coarse.empty()) return picture;
  Source source{bytes, {}};
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, on_png_error, on_warning);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  const std::optional<Transfer> transfer = png_transfer(bytes);
  std::vector<png_bytep> rows;
  if (info) {
    png_set_read_fn(png, &source, read_bytes);
    read_rows(png, info, picture.bgr, rows, transfer.has_value());
  } else {
    source.keep("not enough memory");
  }
  png_destroy_read_struct(&png, &info, nullptr);
  picture.complaint = source.complaint;
  if (transfer && !picture.bgr.empty()) picture.bgr = srgb_of(picture.bgr, *transfer);
  return picture;
}

std::vector<std::uint8_t> encode_png(const cv::Mat& image) {
  const int channels = image.channels();
  if (image.empty() || (image.depth() != CV_8U && image.depth() != CV_16U) ||
      (channels != 1 && channels != 3 && channels != 4))
    return {};
  std::vector<std::uint8_t> bytes;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, on_png_encoding_error, ignore_warning);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  if (info) png_set_write_fn(png, &bytes, append, flush_nothing);
  const bool written = info && write_picture(png, info, image);
  png_destroy_write_struct(&png, &info);
  return written ? bytes : std::vector<std::uint8_t>{};
}

}  // namespace lapservo::internal
