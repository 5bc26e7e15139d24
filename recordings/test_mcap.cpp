#include <algorithm>
#include <cmath>
#include <fstream>
#include <lz4frame.h>
#include <map>
#include <zstd.h>

#include "recordings/test_bags.h"

// https://mcap.dev/spec, section by section; bytes are written one by one.
namespace lapservo::testing {
namespace {

using Text = std::string;

Text number(std::uint64_t value, int bytes) {
  Text text;
  for (int i = 0; i < bytes; ++i, value >>= 8) text += static_cast<char>(value & 255);
  return text;
}
Text string(const Text& text) {
  return number(text.size(), 4) + text;
}
Text record(int opcode, const Text& content) {
  return number(static_cast<std::uint64_t>(opcode), 1) + number(content.size(), 8) + content;
}

std::uint32_t crc32(const Text& text) {
  std::uint32_t crc = ~0u;
  for (const char c : text) {
    crc ^= static_cast<std::uint8_t>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0u);
  }
  return ~crc;
}

Text compressed(const Text& text, const std::string& compression) {
  if (compression.empty()) return text;
  const bool lz4 = compression == "lz4";
  Text packed(lz4 ? LZ4F_compressFrameBound(text.size(), nullptr) : ZSTD_compressBound(text.size()), '\0');
  packed.resize(lz4 ? LZ4F_compressFrame(packed.data(), packed.size(), text.data(), text.size(), nullptr)
                    : ZSTD_compress(packed.data(), packed.size(), text.data(), text.size(), 1));
  return packed;
}

class Writer {
 public:
  Writer(const std::filesystem::path& path, const McapLayout& layout) : file_(path, std::ios::binary), layout_(layout) {
    write(magic);
    write(record(1, string("ros2") + string("test")));
  }

  void add(const BagEntry& entry) {
    const auto [found, is_new] = channels_.emplace(entry.topic, 7 + channels_.size());
    const Text id = number(found->second, 2);
    Text records;
    if (is_new) {
      Text type = entry.type;
      type.insert(type.find('/'), "/msg");
      const Text schema = record(3, id + string(type) + string("ros2msg") + string("float64 x"));
      const Text channel = record(
          4, id + id + string(entry.topic) + string("cdr") + string(string("offered_qos_profiles") + string("")));
      schemas_ += schema, summary_channels_ += channel;
      records = schema + channel;
    }
    const auto time_ns = static_cast<std::uint64_t>(std::llround(1e9 * entry.time_s));
    const Text time = number(time_ns, 8);
    const bool loose =
        layout_.messages_a_chunk == 0 || (layout_.loose_every > 0 && sequence_ % layout_.loose_every == 0);
    if (loose && !chunk_.empty()) end_chunk();
    if (!loose) indexes_[found->second] += time + number(chunk_.size() + records.size(), 8);
    records += record(5, id + number(++sequence_, 4) + time + time + Text(entry.bytes.begin(), entry.bytes.end()));
    ++counts_[found->second];
    first_ns_ = std::min(first_ns_, time_ns), last_ns_ = std::max(last_ns_, time_ns);
    if (loose) return write(records);
    if (chunk_.empty()) chunk_first_ns_ = chunk_last_ns_ = time_ns;
    chunk_first_ns_ = std::min(chunk_first_ns_, time_ns), chunk_last_ns_ = std::max(chunk_last_ns_, time_ns);
    chunk_ += records;
    if (++in_chunk_ == layout_.messages_a_chunk) end_chunk();
  }

  void finish() {
    if (!chunk_.empty()) end_chunk();
    write(record(15, number(0, 4)));
    if (!layout_.with_summary) return write(record(2, number(0, 20)) + magic);
    Text counts;
    for (const auto& [channel, count] : counts_) counts += number(channel, 2) + number(count, 8);
    Text summary = schemas_ + summary_channels_;
    const std::uint64_t begin = size_, statistics = begin + summary.size();
    summary +=
        record(11, number(sequence_, 8) + number(channels_.size(), 2) + number(channels_.size(), 4) + number(0, 8) +
                       number(chunks_, 4) + number(first_ns_, 8) + number(last_ns_, 8) + string(counts));
    summary += chunk_indexes_;
    const std::uint64_t offsets = begin + summary.size();
    summary += record(14, number(11, 1) + number(statistics, 8) + number(offsets - statistics, 8));
    summary += number(2, 1) + number(20, 8) + number(begin, 8) + number(offsets, 8);
    write(summary + number(layout_.with_checksums ? crc32(summary) : 0, 4) + magic);
  }

 private:
  void end_chunk() {
    const Text packed = compressed(chunk_, layout_.compression);
    const Text times = number(chunk_first_ns_, 8) + number(chunk_last_ns_, 8);
    const std::uint64_t begin = size_;
    write(record(6, times + number(chunk_.size(), 8) + number(layout_.with_checksums ? crc32(chunk_) : 0, 4) +
                        string(layout_.compression) + number(packed.size(), 8) + packed));
    const std::uint64_t behind = size_;
    Text offsets;
    for (const auto& [channel, index] : indexes_) {
      offsets += number(channel, 2) + number(size_, 8);
      write(record(7, number(channel, 2) + string(index)));
    }
    chunk_indexes_ +=
        record(8, times + number(begin, 8) + number(behind - begin, 8) + string(offsets) + number(size_ - behind, 8) +
                      string(layout_.compression) + number(packed.size(), 8) + number(chunk_.size(), 8));
    chunk_.clear(), indexes_.clear(), in_chunk_ = 0, ++chunks_;
  }
  void write(const Text& text) {
    file_ << text;
    size_ += text.size();
  }

  inline static const Text magic = "\x89MCAP0\r\n";
  std::ofstream file_;
  McapLayout layout_;
  std::map<Text, std::uint64_t> channels_;
  std::map<std::uint64_t, std::uint64_t> counts_;
  std::map<std::uint64_t, Text> indexes_;
  Text chunk_, schemas_, summary_channels_, chunk_indexes_;
  std::size_t in_chunk_ = 0;
  std::uint64_t size_ = 0, chunks_ = 0, sequence_ = 0, first_ns_ = ~std::uint64_t{0}, last_ns_ = 0, chunk_first_ns_ = 0,
                chunk_last_ns_ = 0;
};

}  // namespace

void write_mcap(const std::filesystem::path& path, const std::vector<BagEntry>& entries, const McapLayout& layout) {
  Writer writer(path, layout);
  for (const BagEntry& entry : entries) writer.add(entry);
  writer.finish();
}

}  // namespace lapservo::testing
