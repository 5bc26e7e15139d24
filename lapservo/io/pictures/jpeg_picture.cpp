#include "lapservo/io/pictures/jpeg_picture.h"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <jerror.h>
#include <jpeglib.h>
#include <optional>
#include <utility>

#include "lapservo/io/pictures/picture_parts.h"

namespace lapservo::internal {
namespace {
using Bytes = std::span<const std::uint8_t>;

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

template <typename Owner>
void leave(j_common_ptr info) {
  std::longjmp(static_cast<Owner*>(info->client_data)->leave, 1);
}

void keep_complaint(j_common_ptr info) {
  auto& complaint = decoder_of(info).complaint;
  if (complaint[0] == '\0') info->err->format_message(info, complaint.data());
}

// Whether a message may be one of bytes that belong to no block: see jpeg_without_strays().
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
  leave<Decoder>(info);
}

void on_progress(j_common_ptr info) {
  Decoder& decoder = decoder_of(info);
  if (decoder.info.input_scan_number <= max_scans) return;
  std::snprintf(decoder.complaint.data(), decoder.complaint.size(), "more than %d scans", max_scans);
  leave<Decoder>(info);
}

void print_nothing(j_common_ptr) {}

void read_header(Decoder& decoder, Bytes bytes) {
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

// All of it into an image, or its coefficients only.
void read_picture(Decoder& decoder, Bytes bytes, cv::Mat* image) {
  if (setjmp(decoder.leave) != 0) return;
  read_header(decoder, bytes);
  if (image) {
    decoder.info.out_color_space = JCS_EXT_BGR;
    jpeg_start_decompress(&decoder.info);
    image->create(static_cast<int>(decoder.info.output_height), static_cast<int>(decoder.info.output_width), CV_8UC3);
    image->setTo(0);
  } else {
    jpeg_read_coefficients(&decoder.info);
  }
  while (image && decoder.info.output_scanline < decoder.info.output_height) {
    JSAMPROW row = image->ptr(static_cast<int>(decoder.info.output_scanline));
    jpeg_read_scanlines(&decoder.info, &row, 1);
  }
  jpeg_finish_decompress(&decoder.info);
}

// As Decoder.
struct Rewriter {
  jpeg_decompress_struct in;
  jpeg_compress_struct out;
  jpeg_error_mgr errors;
  jpeg_destination_mgr destination;
  std::jmp_buf leave;
  std::array<JOCTET, 4096> buffer;
  std::vector<std::uint8_t>* bytes;
};

Rewriter& rewriter_of(j_compress_ptr out) {
  return *static_cast<Rewriter*>(out->client_data);
}

void begin_buffer(j_compress_ptr out) {
  out->dest->next_output_byte = rewriter_of(out).buffer.data();
  out->dest->free_in_buffer = rewriter_of(out).buffer.size();
}

void keep_buffer(j_compress_ptr out) {
  const auto& buffer = rewriter_of(out).buffer;
  const auto used = static_cast<std::ptrdiff_t>(buffer.size() - out->dest->free_in_buffer);
  rewriter_of(out).bytes->insert(rewriter_of(out).bytes->end(), buffer.begin(), buffer.begin() + used);
}

boolean on_full_buffer(j_compress_ptr out) {
  out->dest->free_in_buffer = 0;
  keep_buffer(out);
  begin_buffer(out);
  return TRUE;
}

void ignore_message(j_common_ptr, int) {}

void copy_tables(JHUFF_TBL* const* from, JHUFF_TBL** to, jpeg_compress_struct& out) {
  for (int i = 0; i < NUM_HUFF_TBLS; ++i) {
    if (from[i] == nullptr) continue;
    if (to[i] == nullptr) to[i] = jpeg_alloc_huff_table(reinterpret_cast<j_common_ptr>(&out));
    std::copy(std::begin(from[i]->bits), std::end(from[i]->bits), to[i]->bits);
    std::copy(std::begin(from[i]->huffval), std::end(from[i]->huffval), to[i]->huffval);
  }
}

bool rewrite(Rewriter& rewriter, Bytes jpeg) {
  if (setjmp(rewriter.leave) != 0) return false;
  jpeg_decompress_struct& in = rewriter.in;
  jpeg_compress_struct& out = rewriter.out;
  in.client_data = out.client_data = &rewriter;
  in.err = out.err = jpeg_std_error(&rewriter.errors);
  rewriter.errors.error_exit = leave<Rewriter>;
  rewriter.errors.emit_message = ignore_message;
  jpeg_create_decompress(&in);
  jpeg_create_compress(&out);
  jpeg_mem_src(&in, jpeg.data(), jpeg.size());
  rewriter.destination = {nullptr, 0, begin_buffer, on_full_buffer, keep_buffer};
  out.dest = &rewriter.destination;
  jpeg_read_header(&in, TRUE);
  if (jpeg_has_multiple_scans(&in)) return false;
  jvirt_barray_ptr* const coefficients = jpeg_read_coefficients(&in);
  jpeg_copy_critical_parameters(&in, &out);
  copy_tables(in.dc_huff_tbl_ptrs, out.dc_huff_tbl_ptrs, out);
  copy_tables(in.ac_huff_tbl_ptrs, out.ac_huff_tbl_ptrs, out);
  out.restart_interval = in.restart_interval;
  jpeg_write_coefficients(&out, coefficients);
  jpeg_finish_compress(&out);
  return true;
}

// Empty where that fails.
std::vector<std::uint8_t> rewritten(Bytes jpeg) {
  std::vector<std::uint8_t> bytes;
  Rewriter rewriter{};
  rewriter.bytes = &bytes;
  const bool written = rewrite(rewriter, jpeg);
  jpeg_destroy_compress(&rewriter.out);
  jpeg_destroy_decompress(&rewriter.in);
  return written ? bytes : std::vector<std::uint8_t>();
}

// The data of the first scan, divided at restart markers.
struct Scan {
  std::size_t begin = 0, end = 0;
  std::vector<Bytes> intervals;
};

Scan scan_of(Bytes jpeg) {
  auto segment = jpeg_segment(jpeg, 0);
  while (segment && segment->marker != 0xda) segment = jpeg_segment(jpeg, segment->end);
  if (!segment) return {};
  Scan scan{segment->end, segment->end, {}};
  for (std::size_t at = scan.begin;; at = segment->end) {
    segment = jpeg_segment(jpeg, at);
    scan.end = segment ? segment->begin : jpeg.size();
    scan.intervals.push_back(jpeg.subspan(at, scan.end - at));
    if (!segment || segment->marker < 0xd0 || segment->marker > 0xd7) return scan;
  }
}

bool are_few(Bytes strays) {
  constexpr std::size_t few = 4;  // to the next multiple of what a camera writes at once
  return strays.size() <= few ||
         std::all_of(strays.begin(), strays.end(), [](std::uint8_t byte) { return byte == 0 || byte == 0xff; });
}

bool is_all_but_strays(const Scan& blocks, const Scan& all) {
  return std::ranges::equal(blocks.intervals, all.intervals, [](Bytes of_blocks, Bytes data) {
    return data.size() >= of_blocks.size() && std::equal(of_blocks.begin(), of_blocks.end(), data.begin()) &&
           are_few(data.subspan(of_blocks.size()));
  });
}

CheckedJpeg read_and_check(Bytes bytes, cv::Mat* image) {
  Decoder decoder{};
  read_picture(decoder, bytes, image);
  jpeg_destroy_decompress(&decoder.info);
  if (decoder.complaint[0] != '\0') return {decoder.complaint.data(), {}};
  std::optional<std::vector<std::uint8_t>> clean(std::in_place);
  if (decoder.has_strays) clean = jpeg_without_strays(bytes);
  if (!clean) return {"data that belong to no block, or blocks without data", {}};
  return {"", std::move(*clean)};
}

// As Decoder.
struct Encoder {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  std::jmp_buf leave;
  unsigned char* bytes;  // malloc's
  unsigned long size;
};

bool write_picture(Encoder& encoder, const cv::Mat& image, int quality) {
  if (setjmp(encoder.leave) != 0) return false;
  encoder.info.client_data = &encoder;
  encoder.info.err = jpeg_std_error(&encoder.errors);
  encoder.errors.error_exit = leave<Encoder>;
  encoder.errors.output_message = print_nothing;
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

std::optional<std::vector<std::uint8_t>> jpeg_without_strays(Bytes jpeg) {
  const std::vector<std::uint8_t> anew = rewritten(jpeg);
  const Scan blocks = scan_of(anew), all = scan_of(jpeg);
  if (blocks.intervals.empty() || !is_all_but_strays(blocks, all)) return std::nullopt;
  std::vector<std::uint8_t> clean(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(all.begin));
  clean.insert(clean.end(), anew.begin() + static_cast<std::ptrdiff_t>(blocks.begin),
               anew.begin() + static_cast<std::ptrdiff_t>(blocks.end));
  if (all.end == jpeg.size()) clean.insert(clean.end(), {0xff, 0xd9});
  clean.insert(clean.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(all.end), jpeg.end());
  return clean;
}

DecodedPicture decode_jpeg(Bytes bytes) {
  DecodedPicture picture;
  picture.complaint = read_and_check(bytes, &picture.bgr).complaint;
  return picture;
}

CheckedJpeg check_jpeg(Bytes bytes) {
  return read_and_check(bytes, nullptr);
}

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
