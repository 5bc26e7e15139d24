#include "lapservo/io/pictures/jpeg_strays.h"

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstddef>
#include <cstdio>
#include <jpeglib.h>

#include "lapservo/io/pictures/jpeg_segments.h"

namespace lapservo::internal {
namespace {
using Bytes = std::span<const std::uint8_t>;

// The library leaves by longjmp, so nothing here may have a destructor of its own.
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

void on_rewriting_error(j_common_ptr info) {
  std::longjmp(static_cast<Rewriter*>(info->client_data)->leave, 1);
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
  rewriter.errors.error_exit = on_rewriting_error;
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

}  // namespace lapservo::internal
