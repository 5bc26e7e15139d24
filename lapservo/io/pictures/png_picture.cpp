#include "lapservo/io/pictures/png_picture.h"

#include <algorithm>
#include <png.h>
#include <string_view>
#include <vector>

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

void convert_to_bgr8(png_structp png) {
  png_set_crc_action(png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
  png_set_palette_to_rgb(png);
  png_set_expand_gray_1_2_4_to_8(png);
  png_set_gray_to_rgb(png);
  png_set_scale_16(png);
  png_set_strip_alpha(png);
  png_set_bgr(png);
  png_set_interlace_handling(png);
}

// The library leaves by longjmp: nothing here may have a destructor.
void read_rows(png_structp png, png_infop info, cv::Mat& image, std::vector<png_bytep>& rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return;
  png_read_info(png, info);
  convert_to_bgr8(png);
  png_read_update_info(png, info);
  if (png_get_rowbytes(png, info) != std::size_t{3} * png_get_image_width(png, info))
    png_error(png, "is of no kind known");
  image.create(static_cast<int>(png_get_image_height(png, info)), static_cast<int>(png_get_image_width(png, info)),
               CV_8UC3);
  image.setTo(0);
  rows.resize(static_cast<std::size_t>(image.rows));
  for (int v = 0; v < image.rows; ++v) rows[static_cast<std::size_t>(v)] = image.ptr(v);
  png_read_image(png, rows.data());
  png_read_end(png, info);
}

}  // namespace

DecodedPicture decode_png(std::span<const std::uint8_t> bytes) {
  Source source{bytes, {}};
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, on_png_error, on_warning);
  png_infop info = png ? png_create_info_struct(png) : nullptr;
  DecodedPicture picture;
  std::vector<png_bytep> rows;
  if (info) {
    png_set_read_fn(png, &source, read_bytes);
    read_rows(png, info, picture.bgr, rows);
  } else {
    source.keep("not enough memory");
  }
  png_destroy_read_struct(&png, &info, nullptr);
  picture.complaint = source.complaint;
  return picture;
}

}  // namespace lapservo::internal
