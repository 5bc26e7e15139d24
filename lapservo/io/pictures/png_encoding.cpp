#include "lapservo/io/pictures/png_encoding.h"

#include <bit>
#include <png.h>
#include <zlib.h>

namespace lapservo::internal {
namespace {

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

// The library leaves by longjmp: nothing here may have a destructor.
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
