#include "recordings/ros1_chunk.h"

#include <bzlib.h>
#include <lz4frame.h>
#include <memory>
#include <utility>

namespace lapservo::internal {
namespace {

using Bytes = std::vector<std::uint8_t>;

bool inflate_bz2(Bytes& from, Bytes& to) {
  auto size = static_cast<unsigned>(to.size());
  return BZ2_bzBuffToBuffDecompress(reinterpret_cast<char*>(to.data()), &size, reinterpret_cast<char*>(from.data()),
                                    static_cast<unsigned>(from.size()), 0, 0) == BZ_OK &&
         size == to.size();
}

bool inflate_lz4(const Bytes& from, Bytes& to) {
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION))) return false;
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(made,
                                                                                     LZ4F_freeDecompressionContext);
  std::size_t read = 0, written = 0, wanted = 1;
  while (wanted != 0) {
    std::size_t in = from.size() - read, out = to.size() - written;
    wanted = LZ4F_decompress(context.get(), to.data() + written, &out, from.data() + read, &in, nullptr);
    if (LZ4F_isError(wanted) || (in == 0 && out == 0)) return false;
    read += in, written += out;
  }
  return written == to.size();
}

}  // namespace

std::optional<Bytes> uncompressed_chunk(const std::string& compression, Bytes bytes, std::uint32_t size) {
  constexpr std::uint32_t most = 256u << 20;
  if (compression == "none") {
    if (bytes.size() != size) return std::nullopt;
    return bytes;
  }
  if (size > most) return std::nullopt;
  Bytes content(size);
  const bool whole = compression == "bz2"   ? inflate_bz2(bytes, content)
                     : compression == "lz4" ? inflate_lz4(bytes, content)
                                            : false;
  if (!whole) return std::nullopt;
  return content;
}

}  // namespace lapservo::internal
