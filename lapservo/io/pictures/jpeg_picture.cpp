#include "lapservo/io/pictures/jpeg_picture.h"

#include <array>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <jerror.h>
#include <jpeglib.h>
#include <optional>
#include <utility>

#include "lapservo/io/pictures/jpeg_strays.h"

namespace lapservo::internal {
namespace {

constexpr int max_scans = 64;  // of a progressive image; some files have thousands, to take minutes

// The library leaves by longjmp, so nothing here or in what reads may have a destructor of its own.
struct Decoder {
  jpeg_decompress_struct info;
  jpeg_error_mgr errors;
  jpeg_progress_mgr progress;
  std::jmp_buf leave;
  std::array<char, JMSG_LENGTH_MAX> complaint;
  bool has_strays;  // bytes before a marker within the scan, or no end marker
};

Decoder& decoder_of(j_common_ptr info) {
  return *static_cast<Decoder*>(info->client_data);
}

void keep_complaint(j_common_ptr info) {
  auto& complaint = decoder_of(info).complaint;
  if (complaint[0] == '\0') info->err->format_message(info, complaint.data());
}

// Whether a message may be one of bytes that belong to no block: see jpeg_strays.h.
bool is_of_strays(j_common_ptr info) {
  const int message = info->err->msg_code;
  return decoder_of(info).info.input_scan_number > 0 && (message == JWRN_EXTRANEOUS_DATA || message == JWRN_JPEG_EOF);
}

void on_message(j_common_ptr info, int level) {
  if (level >= 0) return;
  if (is_of_strays(info)) {
    decoder_of(info).has_strays = true;
  } else {
    keep_complaint(info);
  }
}

void on_jpeg_error(j_common_ptr info) {
  keep_complaint(info);
  std::longjmp(decoder_of(info).leave, 1);
}

void on_progress(j_common_ptr info) {
  Decoder& decoder = decoder_of(info);
  if (decoder.info.input_scan_number <= max_scans) return;
  std::snprintf(decoder.complaint.data(), decoder.complaint.size(), "more than %d scans", max_scans);
  std::longjmp(decoder.leave, 1);
}

void print_nothing(j_common_ptr) {}

void read_header(Decoder& decoder, std::span<const std::uint8_t> bytes) {
  decoder.info.client_data = &decoder;
  decoder.info.err = jpeg_std_error(&decoder.errors);
  decoder.errors.error_exit = on_jpeg_error;
  decoder.errors.emit_message = on_message;
  decoder.errors.output_message = print_nothing;
  decoder.progress.progress_monitor = on_progress;
  jpeg_create_decompress(&decoder.info);
  decoder.info.progress = &decoder.progress;
  jpeg_mem_src(&decoder.info, bytes.data(), bytes.size());
  jpeg_read_header(&decoder.info, TRUE);
}

void read_coefficients(Decoder& decoder, std::span<const std::uint8_t> bytes) {
  if (setjmp(decoder.leave) != 0) return;
  read_header(decoder, bytes);
  jpeg_read_coefficients(&decoder.info);
  jpeg_finish_decompress(&decoder.info);
}

void read_picture(Decoder& decoder, std::span<const std::uint8_t> bytes, cv::Mat& image) {
  if (setjmp(decoder.leave) != 0) return;
  read_header(decoder, bytes);
  decoder.info.out_color_space = JCS_EXT_BGR;
  jpeg_start_decompress(&decoder.info);
  image.create(static_cast<int>(decoder.info.output_height), static_cast<int>(decoder.info.output_width), CV_8UC3);
  image.setTo(0);
  while (decoder.info.output_scanline < decoder.info.output_height) {
    JSAMPROW row = image.ptr(static_cast<int>(decoder.info.output_scanline));
    jpeg_read_scanlines(&decoder.info, &row, 1);
  }
  jpeg_finish_decompress(&decoder.info);
}

CheckedJpeg checked(const Decoder& decoder, std::span<const std::uint8_t> bytes) {
  if (decoder.complaint[0] != '\0') return {decoder.complaint.data(), {}};
  std::optional<std::vector<std::uint8_t>> clean(std::in_place);
  if (decoder.has_strays) clean = jpeg_without_strays(bytes);
  if (!clean) return {"data that belong to no block, or blocks without data", {}};
  return {"", std::move(*clean)};
}

}  // namespace

DecodedPicture decode_jpeg(std::span<const std::uint8_t> bytes) {
  Decoder decoder{};
  DecodedPicture picture;
  read_picture(decoder, bytes, picture.bgr);
  jpeg_destroy_decompress(&decoder.info);
  picture.complaint = checked(decoder, bytes).complaint;
  return picture;
}

CheckedJpeg check_jpeg(std::span<const std::uint8_t> bytes) {
  Decoder decoder{};
  read_coefficients(decoder, bytes);
  jpeg_destroy_decompress(&decoder.info);
  return checked(decoder, bytes);
}

}  // namespace lapservo::internal
