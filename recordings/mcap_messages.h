#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "recordings/file_bytes.h"
#include "recordings/mcap_format.h"
#include "recordings/ros2_file.h"

namespace lapservo::internal {

/// The channels of an MCAP file by their numbers. The first record of each counts.
struct McapChannels {
  std::map<std::uint16_t, std::string> types;  ///< by the schema
  std::map<std::uint16_t, Ros2FileTopic> topics;

  /// Takes records of schemas and channels, passes over others. False for those that are too short.
  bool add(mcap::Op op, ByteView content);
};

/// Whether the bytes have that checksum, which 0 leaves open.
bool has_mcap_crc(ByteView bytes, std::uint32_t crc);

/// The messages of a part of an MCAP file, those of a chunk in its place. One chunk at a time is in memory.
class McapMessages {
 public:
  struct Message {
    std::uint16_t channel = 0;
    std::uint64_t time_ns = 0;
  };

  /// From the record at byte `begin` on. `may_end_early`: `end` may be within a record, as where a recorder was killed;
  /// of a chunk there, the whole messages count.
  McapMessages(FileBytes& file, std::uint64_t begin, std::uint64_t end, bool may_end_early)
      : file_(file), at_(begin), end_(end), may_end_early_(may_end_early) {}

  /// nullopt at the end. Throws InputError for what is damaged.
  std::optional<Message> next();
  /// The latest message's, until next().
  ByteView data();
  /// Those seen so far.
  const McapChannels& channels() const { return channels_; }
  /// The first byte that is in no whole record.
  std::optional<std::uint64_t> ends_early_at() const { return ends_early_at_; }
  /// Whether the end of the messages has been seen, which a recorder that was killed does not write.
  bool is_finished() const { return is_finished_; }

 private:
  std::optional<Message> next_in_chunk();
  std::optional<Message> next_in_file();
  void open_chunk(std::uint64_t at, std::uint64_t size);
  bool unpack_chunk();

  FileBytes& file_;
  std::uint64_t at_, end_, chunk_at_ = 0;
  bool may_end_early_, is_finished_ = false;
  std::optional<std::uint64_t> ends_early_at_;
  McapChannels channels_;
  Bytes chunk_, loose_;
  ByteView rest_, data_;                       // within chunk_; data_ may be loose_
  std::uint64_t data_at_ = 0, data_size_ = 0;  // of a message outside of chunks that is not in loose_ yet
};

}  // namespace lapservo::internal
