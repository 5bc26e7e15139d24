#include "lapservo/io/pictures/jpeg_picture.h"

#include <array>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <jerror.h>
#include <jpeglib.h>
#include <optional>
#include <utility>

#include "lapservo/io/pictures/jpeg_blocks.h"
#include "lapservo/io/pictures/jpeg_dc_shift.h"
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

void check_scans(Decoder& decoder) {
  if (decoder.info.input_scan_number <= max_scans) return;
  std::snprintf(decoder.complaint.data(), decoder.complaint.size(), "more than %d scans", max_scans);
  std::longjmp(decoder.leave, 1);
}

void on_progress(j_common_ptr info) {
  check_scans(decoder_of(info));
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

struct Blocks {
  std::vector<JpegComponent> components;
  int restart_interval = 0;
};

// The caller owns the vectors, which a jump from here leaves alone.
void keep_blocks(Decoder& decoder, jvirt_barray_ptr* coefficients, Blocks& blocks) {
  blocks.restart_interval = static_cast<int>(decoder.info.restart_interval);
  blocks.components.resize(static_cast<std::size_t>(decoder.info.num_components));
  for (int i = 0; i < decoder.info.num_components; ++i)
    read_component(decoder.info, i, coefficients[i], blocks.components[static_cast<std::size_t>(i)]);
}

void read_blocks(Decoder& decoder, std::span<const std::uint8_t> bytes, Blocks& blocks) {
  if (setjmp(decoder.leave) != 0) return;
  read_header(decoder, bytes);
  keep_blocks(decoder, jpeg_read_coefficients(&decoder.info), blocks);
  jpeg_finish_decompress(&decoder.info);
}

// All data first, so that their blocks are there beside the image.
void read_picture(Decoder& decoder, std::span<const std::uint8_t> bytes, Blocks& blocks, cv::Mat& image) {
  if (setjmp(decoder.leave) != 0) return;
  read_header(decoder, bytes);
  decoder.info.out_color_space = JCS_EXT_BGR;
  decoder.info.buffered_image = TRUE;
  jpeg_start_decompress(&decoder.info);
  image.create(static_cast<int>(decoder.info.output_height), static_cast<int>(decoder.info.output_width), CV_8UC3);
  image.setTo(0);
  while (jpeg_consume_input(&decoder.info) != JPEG_REACHED_EOI) check_scans(decoder);
  keep_blocks(decoder, jpeg_read_coefficients(&decoder.info), blocks);
  jpeg_start_output(&decoder.info, decoder.info.input_scan_number);
  while (decoder.info.output_scanline < decoder.info.output_height) {
    JSAMPROW row = image.ptr(static_cast<int>(decoder.info.output_scanline));
    jpeg_read_scanlines(&decoder.info, &row, 1);
  }
  jpeg_finish_output(&decoder.info);
  jpeg_finish_decompress(&decoder.info);
}

std::string shift_complaint(const Blocks& blocks) {
  for (const JpegComponent& component : blocks.components) {
    if (component.has_impossible) return "blocks that are darker than black or brighter than white";
    if (dc_shift({component.steps, component.quantum, component.columns, blocks.restart_interval}))
      return "colours that are shifted from within a row of blocks on";
  }
  return {};
}

CheckedJpeg checked(const Decoder& decoder, const Blocks& blocks, std::span<const std::uint8_t> bytes) {
  if (decoder.complaint[0] != '\0') return {decoder.complaint.data(), {}};
  std::optional<std::vector<std::uint8_t>> clean(std::in_place);
  if (decoder.has_strays) clean = jpeg_without_strays(bytes);
  if (!clean) return {"data that belong to no block, or blocks without data", {}};
  return {shift_complaint(blocks), std::move(*clean)};
}

}  // namespace

DecodedPicture decode_jpeg(std::span<const std::uint8_t> bytes) {
  Decoder decoder{};
  Blocks blocks;
  DecodedPicture picture;
  read_picture(decoder, bytes, blocks, picture.bgr);
  jpeg_destroy_decompress(&decoder.info);
  picture.complaint = checked(decoder, blocks, bytes).complaint;
  return picture;
}

CheckedJpeg check_jpeg(std::span<const std::uint8_t> bytes) {
  Decoder decoder{};
  Blocks blocks;
  read_blocks(decoder, bytes, blocks);
  jpeg_destroy_decompress(&decoder.info);
  return checked(decoder, blocks, bytes);
}

}  // namespace lapservo::internal
