#include "lapservo/io/pictures/jpeg_encoding.h"

#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <jpeglib.h>

namespace lapservo::internal {
namespace {

// The library leaves by longjmp, so nothing here may have a destructor of its own.
struct Encoder {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  std::jmp_buf leave;
  unsigned char* bytes;  // malloc's
  unsigned long size;
};

void on_jpeg_encoding_error(j_common_ptr info) {
  std::longjmp(static_cast<Encoder*>(info->client_data)->leave, 1);
}

void ignore_jpeg_message(j_common_ptr) {}

bool write_picture(Encoder& encoder, const cv::Mat& image, int quality) {
  if (setjmp(encoder.leave) != 0) return false;
  encoder.info.client_data = &encoder;
  encoder.info.err = jpeg_std_error(&encoder.errors);
  encoder.errors.error_exit = on_jpeg_encoding_error;
  encoder.errors.output_message = ignore_jpeg_message;
  jpeg_create_compress(&encoder.info);
  jpeg_mem_dest(&encoder.info, &encoder.bytes, &encoder.size);
  encoder.info.image_width = static_cast<JDIMENSION>(image.cols);
  encoder.info.image_height = static_cast<JDIMENSION>(image.rows);
  encoder.info.input_components = image.channels();
  encoder.info.in_color_space = image.channels() == 1 ? JCS_GRAYSCALE : JCS_EXT_BGR;
  jpeg_set_defaults(&encoder.info);
  jpeg_set_quality(&encoder.info, quality, TRUE);
  jpeg_start_compress(&encoder.info, TRUE);
  while (encoder.info.next_scanline < encoder.info.image_height) {
    auto* row = const_cast<JSAMPLE*>(image.ptr(static_cast<int>(encoder.info.next_scanline)));
    jpeg_write_scanlines(&encoder.info, &row, 1);
  }
  jpeg_finish_compress(&encoder.info);
  return true;
}

}  // namespace

std::vector<std::uint8_t> encode_jpeg(const cv::Mat& image, int quality) {
  if (image.empty() || (image.type() != CV_8UC1 && image.type() != CV_8UC3)) return {};
  Encoder encoder{};
  const bool written = write_picture(encoder, image, quality);
  jpeg_destroy_compress(&encoder.info);
  if (!written) return {};  // out of memory: whose the bytes are then, the library does not say
  std::vector<std::uint8_t> bytes(encoder.bytes, encoder.bytes + encoder.size);
  std::free(encoder.bytes);
  return bytes;
}

}  // namespace lapservo::internal
