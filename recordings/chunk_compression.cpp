#include "recordings/chunk_compression.h"

#include <algorithm>
#include <bzlib.h>
#include <lz4frame.h>
#include <memory>
#include <zstd.h>

namespace lapservo::internal {
namespace {

struct Step {
  std::size_t read = 0, written = 0;
  bool damaged = false, ended = false;
};

// `one_step(from, to)` goes on with what is left of both. The memory grows with the content, not with the size that is
// claimed.
template <typename OneStep>
std::optional<Bytes> stepwise(ByteView from, std::size_t size, const OneStep& one_step) {
  constexpr std::size_t least = std::size_t{1} << 20;
  Bytes content;
  std::size_t written = 0;
  for (Step step; !step.ended || written < size; from = from.subspan(step.read), written += step.written) {
    if (written == content.size()) content.resize(std::min(size, std::max(least, 2 * written)));
    step = one_step(from, std::span(content).subspan(written));
    if (step.damaged) return std::nullopt;
    if (step.read > 0 || step.written > 0) continue;
    if (!step.ended && !from.empty()) return std::nullopt;  // there is more than `size`
    break;
  }
  content.resize(written);
  return content;
}

std::optional<Bytes> inflated_bz2(ByteView from, std::size_t size) {
  bz_stream stream{};
  if (BZ2_bzDecompressInit(&stream, 0, 0) != BZ_OK) return std::nullopt;
  const std::unique_ptr<bz_stream, decltype(&BZ2_bzDecompressEnd)> end(&stream, BZ2_bzDecompressEnd);
  return stepwise(from, size, [&](ByteView in, std::span<std::uint8_t> out) {
    stream.next_in = reinterpret_cast<char*>(const_cast<std::uint8_t*>(in.data()));
    stream.next_out = reinterpret_cast<char*>(out.data());
    stream.avail_in = static_cast<unsigned>(in.size()), stream.avail_out = static_cast<unsigned>(out.size());
    const int result = BZ2_bzDecompress(&stream);
    return Step{in.size() - stream.avail_in, out.size() - stream.avail_out, result != BZ_OK && result != BZ_STREAM_END,
                result == BZ_STREAM_END};
  });
}

std::optional<Bytes> inflated_lz4(ByteView from, std::size_t size) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION))) return std::nullopt;
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(made,
                                                                                     LZ4F_freeDecompressionContext);
  return stepwise(from, size, [&](ByteView in, std::span<std::uint8_t> out) {
    Step step{in.size(), out.size()};
    const std::size_t wanted =
        LZ4F_decompress(context.get(), out.data(), &step.written, in.data(), &step.read, nullptr);
    step.damaged = LZ4F_isError(wanted) != 0, step.ended = wanted == 0;
    return step;
  });
}

std::optional<Bytes> inflated_zstd(ByteView from, std::size_t size) {
  const std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(), ZSTD_freeDStream);
  if (!stream) return std::nullopt;
  return stepwise(from, size, [&](ByteView in, std::span<std::uint8_t> out) {
    ZSTD_inBuffer input{in.data(), in.size(), 0};
    ZSTD_outBuffer output{out.data(), out.size(), 0};
    const std::size_t wanted = ZSTD_decompressStream(stream.get(), &output, &input);
    return Step{input.pos, output.pos, ZSTD_isError(wanted) != 0, wanted == 0};
  });
}

}  // namespace

std::optional<Bytes> inflated(const std::string& compression, ByteView from, std::size_t size) {
  if (compression == "bz2") return inflated_bz2(from, size);
  if (compression == "lz4") return inflated_lz4(from, size);
  if (compression == "zstd") return inflated_zstd(from, size);
  return std::nullopt;
}

}  // namespace lapservo::internal
