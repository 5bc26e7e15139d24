#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <zlib.h>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "recordings/chunk_compression.h"
#include "recordings/file_bytes.h"
#include "recordings/mcap_format.h"
#include "recordings/ros2_file.h"

namespace lapservo::internal {
using namespace mcap;
namespace {

[[noreturn]] void refuse_damage(const FileBytes& file, std::uint64_t at) {
  throw InputError(file.path(),
                   fmt::format("is damaged at byte {}, expected a whole MCAP recording: copy it again, or try "
                               "`mcap recover`",
                               at));
}

std::optional<std::string> text_taken(ByteView& from) {
  const auto text = block_taken(from);
  return text ? std::optional(std::string(text->begin(), text->end())) : std::nullopt;
}

// The channels of an MCAP file by their numbers. The first record of each counts.
struct McapChannels {
  std::map<std::uint16_t, std::string> types;  ///< by the schema
  std::map<std::uint16_t, Ros2FileTopic> topics;

  // Takes records of schemas and channels, passes over others. False for those that are too short.
  bool add(Op op, ByteView content) {
    if (op != Op::schema && op != Op::channel) return true;
    const auto number = taken<std::uint16_t>(content);
    const auto schema = op == Op::channel ? taken<std::uint16_t>(content) : std::optional<std::uint16_t>(0);
    const auto name = text_taken(content), format = text_taken(content);
    if (!number || !schema || !format) return false;
    if (op == Op::schema) return types.emplace(*number, *name), true;
    const auto type = types.find(*schema);
    topics.try_emplace(*number, Ros2FileTopic{*name, type == types.end() ? std::string() : type->second, *format});
    return true;
  }
};

// Whether the bytes have that checksum, which 0 leaves open.
bool has_mcap_crc(ByteView bytes, std::uint32_t crc) {
  return crc == 0 || crc == crc32_z(0, bytes.data(), bytes.size());
}

// The messages of a part of an MCAP file, those of a chunk in its place. One chunk at a time is in memory.
class McapMessages {
 public:
  struct Message {
    std::uint16_t channel = 0;
    std::uint64_t time_ns = 0;
  };

  // The head of a message's record, without its data.
  static std::optional<Message> message_taken(ByteView& from) {
    const auto channel = taken<std::uint16_t>(from);
    taken<std::uint32_t>(from);  // its sequence number
    const auto recorded_ns = taken<std::uint64_t>(from), published_ns = taken<std::uint64_t>(from);
    if (!published_ns) return std::nullopt;
    return Message{*channel, *recorded_ns};
  }

  // From the record at byte `begin` on. `may_end_early`: `end` may be within a record, as where a recorder was killed;
  // of a chunk there, the whole messages count.
  McapMessages(FileBytes& file, std::uint64_t begin, std::uint64_t end, bool may_end_early)
      : file_(file), at_(begin), end_(end), may_end_early_(may_end_early) {}

  // nullopt at the end. Throws InputError for what is damaged.
  std::optional<Message> next() {
    while (!rest_.empty() || at_ < end_)
      if (const auto message = rest_.empty() ? next_in_file() : next_in_chunk()) return message;
    return std::nullopt;
  }

  // The latest message's, until next().
  ByteView data() {
    if (data_at_ == 0) return data_;
    auto bytes = file_.bytes(data_at_, data_size_);
    if (!bytes) refuse_damage(file_, data_at_);
    loose_ = std::move(*bytes);
    data_at_ = 0;
    return data_ = loose_;
  }

  // Those seen so far.
  const McapChannels& channels() const { return channels_; }
  // The first byte that is in no whole record.
  std::optional<std::uint64_t> ends_early_at() const { return ends_early_at_; }
  // Whether the end of the messages has been seen, which a recorder that was killed does not write.
  bool is_finished() const { return is_finished_; }

 private:
  std::optional<Message> next_in_chunk() {
    const auto op = taken<Op>(rest_);
    const auto content = block_taken<std::uint64_t>(rest_);
    data_ = content.value_or(ByteView()), data_at_ = 0;
    const auto message = op == Op::message ? message_taken(data_) : std::nullopt;
    if (content && op != Op::none && (message || op != Op::message) && channels_.add(*op, *content)) return message;
    if (!ends_early_at_) refuse_damage(file_, chunk_at_);
    rest_ = {};
    return std::nullopt;
  }

  std::optional<Message> next_in_file() {
    const std::uint64_t begin = at_, left = end_ - begin;
    const auto head = file_.bytes(begin, std::min(left, record_head));
    if (!head) refuse_damage(file_, begin);
    ByteView from(*head);
    const auto op = taken<Op>(from);
    const auto size = taken<std::uint64_t>(from);
    const bool is_whole = size && op != Op::none && *size <= left - record_head;
    is_finished_ = is_whole && (op == Op::data_end || op == Op::footer);
    at_ = is_whole && !is_finished_ ? begin + record_head + *size : end_;
    if (!is_whole) {
      if (!may_end_early_) refuse_damage(file_, begin);
      ends_early_at_ = begin;
      if (size && op == Op::chunk) open_chunk(begin, left - record_head);
      return std::nullopt;
    }
    if (op == Op::chunk) open_chunk(begin, *size);
    if (op == Op::schema || op == Op::channel) {
      const auto content = file_.bytes(begin + record_head, *size);
      if (!content || !channels_.add(*op, *content)) refuse_damage(file_, begin);
    }
    if (op != Op::message) return std::nullopt;
    const auto fields = file_.bytes(begin + record_head, std::min(*size, message_head));
    ByteView of_message = fields ? ByteView(*fields) : ByteView();
    const auto message = message_taken(of_message);
    if (!message) refuse_damage(file_, begin);
    data_at_ = begin + record_head + message_head, data_size_ = *size - message_head;
    return message;
  }

  void open_chunk(std::uint64_t at, std::uint64_t size) {
    chunk_at_ = at;
    auto bytes = size <= most_of_a_chunk ? file_.bytes(at + record_head, size) : std::nullopt;
    if (!bytes) refuse_damage(file_, at);
    chunk_ = std::move(*bytes);
    if (unpack_chunk()) return;
    rest_ = {};
    if (!ends_early_at_) refuse_damage(file_, at);
  }

  // False for what is damaged. One that ends early has no checksum.
  bool unpack_chunk() {
    ByteView from(chunk_);
    taken<std::array<std::uint64_t, 2>>(from);  // its times
    const auto size = taken<std::uint64_t>(from);
    const auto crc = taken<std::uint32_t>(from);
    const auto compression = text_taken(from);
    const auto packed_size = taken<std::uint64_t>(from);
    if (!packed_size || *size > most_of_a_chunk) return false;
    from = from.first(std::min<std::uint64_t>(*packed_size, from.size()));
    const bool is_whole = !ends_early_at_ && from.size() == *packed_size;
    rest_ = from;
    if (!compression->empty()) {
      auto content = inflated(*compression, from, *size);
      if (!content) return false;
      chunk_ = std::move(*content);
      rest_ = chunk_;
    }
    return ends_early_at_ || (is_whole && rest_.size() == *size && has_mcap_crc(rest_, *crc));
  }

  FileBytes& file_;
  std::uint64_t at_, end_, chunk_at_ = 0;
  bool may_end_early_, is_finished_ = false;
  std::optional<std::uint64_t> ends_early_at_;
  McapChannels channels_;
  Bytes chunk_, loose_;
  ByteView rest_, data_;                       // within chunk_; data_ may be loose_
  std::uint64_t data_at_ = 0, data_size_ = 0;  // of a message outside of chunks that is not in loose_ yet
};

using ChannelNumbers = std::set<std::uint16_t>;

// A part of a file with messages: all of it, a chunk, or a message outside of chunks.
struct Part {
  std::uint64_t begin = 0, end = 0;
  std::uint64_t first_ns = 0;  // of a chunk, a message
  ChannelNumbers channels;     // of its messages; empty: not known
};

struct Contents {
  Part all;
  std::vector<Part> chunks;  // and messages beside them, by their times; none where no chunks are known
  McapChannels channels;
  std::optional<std::uint64_t> ends_early_at;
};

FileBytes opened(const std::string& path) {
  return FileBytes(path, "an MCAP recording");
}

// The summary of a file that was finished.
class Summary {
 public:
  // nullopt where there is none, or none that counts messages and chunks.
  static std::optional<Contents> read(FileBytes& file) {
    constexpr std::uint64_t tail = record_head + footer_size + magic.size(), most = 256 << 20;
    if (file.size() < magic.size() + tail) return std::nullopt;
    const std::uint64_t end = file.size() - tail;
    const auto footer = file.bytes(end, tail);
    ByteView from = footer ? ByteView(*footer) : ByteView();
    const auto op = taken<Op>(from);
    const auto size = taken<std::uint64_t>(from), begin = taken<std::uint64_t>(from);
    taken<std::uint64_t>(from);  // of the summary's own index
    const auto crc = taken<std::uint32_t>(from);
    if (op != Op::footer || size != footer_size || !std::equal(from.begin(), from.end(), magic.begin(), magic.end()) ||
        *begin < magic.size() || *begin > end || end - *begin > most)
      return std::nullopt;
    const auto bytes = file.bytes(*begin, end + record_head + footer_size - sizeof *crc - *begin);
    if (!bytes || !has_mcap_crc(*bytes, *crc)) return std::nullopt;
    Summary summary(*begin);
    return summary.add_all(file, ByteView(*bytes).first(end - *begin)) ? std::optional(summary.contents_)
                                                                       : std::nullopt;
  }

 private:
  explicit Summary(std::uint64_t end) : end_(end) { contents_.all = {magic.size(), end, 0, {}}; }

  bool add_all(FileBytes& file, ByteView from) {
    ByteView statistics;
    while (!from.empty()) {
      const auto op = taken<Op>(from);
      const auto content = block_taken<std::uint64_t>(from);
      if (!content || !contents_.channels.add(*op, *content)) return false;
      if (op == Op::chunk_index && !add_chunk(*content)) return false;
      if (op == Op::statistics) statistics = *content;
    }
    const std::size_t chunks = contents_.chunks.size();
    if (chunks > 0 && !add_loose(file)) return false;
    std::sort(contents_.chunks.begin(), contents_.chunks.end(), [](const Part& a, const Part& b) {
      return std::pair(a.first_ns, a.begin) < std::pair(b.first_ns, b.begin);
    });
    return add_counts(statistics, chunks);
  }
  bool add_chunk(ByteView from) {
    const auto first_ns = taken<std::uint64_t>(from), last_ns = taken<std::uint64_t>(from);
    const auto begin = taken<std::uint64_t>(from), size = taken<std::uint64_t>(from);
    auto indexes = block_taken(from);
    if (!indexes || *begin < magic.size() || *begin > end_ || *size > end_ - *begin) return false;
    Part part{*begin, *begin + *size, *first_ns, {}};
    while (const auto channel = taken<std::uint16_t>(*indexes)) {
      taken<std::uint64_t>(*indexes);  // where in the chunk
      part.channels.insert(*channel);
      add_times(*channel, *first_ns, *last_ns);
    }
    ends_[*begin] = part.end + std::min(taken<std::uint64_t>(from).value_or(0), end_ - part.end);
    contents_.chunks.push_back(std::move(part));
    return true;
  }
  // The messages between chunks, which no index has; the format allows them.
  bool add_loose(FileBytes& file) {
    ends_.try_emplace(end_, end_);
    std::uint64_t at = magic.size();
    for (const auto& [begin, end] : ends_) {
      while (at < begin) {
        const auto head = file.bytes(at, std::min(begin - at, record_head + message_head));
        ByteView from = head ? ByteView(*head) : ByteView();
        const auto op = taken<Op>(from);
        const auto size = taken<std::uint64_t>(from);
        if (!size || *size > begin - at - record_head) return false;
        Part part{at, at + record_head + *size, 0, {}};
        at = part.end;
        if (op != Op::message) continue;
        const auto message = McapMessages::message_taken(from);
        if (!message) return false;
        part.first_ns = message->time_ns, part.channels.insert(message->channel);
        add_times(message->channel, message->time_ns, message->time_ns);
        contents_.chunks.push_back(std::move(part));
      }
      at = std::max(at, end);
    }
    return true;
  }
  void add_times(std::uint16_t channel, std::uint64_t first_ns, std::uint64_t last_ns) {
    const auto [times, is_new] = times_.try_emplace(channel, first_ns, last_ns);
    times->second = {std::min(times->second.first, first_ns), std::max(times->second.second, last_ns)};
  }
  bool add_counts(ByteView from, std::size_t indexed) {
    const auto messages = taken<std::uint64_t>(from);
    taken<std::uint16_t>(from);                 // schemas
    taken<std::array<std::uint32_t, 3>>(from);  // channels, attachments, metadata
    const auto chunks = taken<std::uint32_t>(from);
    const auto first_ns = taken<std::uint64_t>(from), last_ns = taken<std::uint64_t>(from);
    auto counts = block_taken(from);
    if (!counts || *chunks != indexed || (counts->empty() && *messages > 0)) return false;
    while (const auto channel = taken<std::uint16_t>(*counts)) {
      const auto counted = taken<std::uint64_t>(*counts);
      const auto topic = contents_.channels.topics.find(*channel);
      const bool is_known = topic != contents_.channels.topics.end() && !topic->second.type.empty();
      if (!counted || !is_known) return false;  // schemas need not be repeated
      const auto times = times_.try_emplace(*channel, *first_ns, *last_ns).first->second;
      if (*counted > 0) topic->second.count(*counted, times.first, times.second);
    }
    return true;
  }

  std::uint64_t end_;  // of the messages
  Contents contents_;
  std::map<std::uint64_t, std::uint64_t> ends_;  // of chunks with their indexes, by where they begin
  std::map<std::uint16_t, std::pair<std::uint64_t, std::uint64_t>> times_;
};

// All messages are read to count them.
Contents found_by_reading(FileBytes& file) {
  Contents contents;
  contents.all = {magic.size(), file.size(), 0, {}};
  McapMessages messages(file, magic.size(), file.size(), true);
  std::map<std::uint16_t, Ros2FileTopic> counted;
  while (const auto message = messages.next()) counted[message->channel].count(1, message->time_ns, message->time_ns);
  contents.channels = messages.channels();
  for (auto& [number, topic] : contents.channels.topics)
    topic.count(counted[number].messages, counted[number].first_ns, counted[number].last_ns);
  if (!messages.is_finished()) contents.ends_early_at = messages.ends_early_at().value_or(file.size());
  return contents;
}

// The messages of chunks and beside them in the order of their times. Chunks may overlap in time, so each is read when
// a message of it may be the next.
class IndexedMessages {
 public:
  IndexedMessages(const std::string& path, std::vector<Part> chunks, ChannelNumbers channels)
      : file_(opened(path)), chunks_(std::move(chunks)), channels_(std::move(channels)) {}

  std::optional<Ros2RawMessage> next() {
    constexpr std::size_t most = std::size_t{128} << 20;  // of bytes that wait, whatever their order is
    while (next_ < chunks_.size() &&
           (ahead_.empty() || (bytes_ahead_ < most && ahead_.begin()->first >= chunks_[next_].first_ns)))
      read(chunks_[next_++]);
    if (ahead_.empty()) return std::nullopt;
    auto first = ahead_.extract(ahead_.begin());
    content_ = std::move(first.mapped());
    bytes_ahead_ -= content_.size();
    return Ros2RawMessage{first.key(), content_};
  }

 private:
  void read(const Part& chunk) {
    McapMessages messages(file_, chunk.begin, chunk.end, false);
    while (const auto message = messages.next())
      if (channels_.contains(message->channel)) {
        const ByteView data = messages.data();
        ahead_.emplace(message->time_ns, Bytes(data.begin(), data.end()));
        bytes_ahead_ += data.size();
      }
  }

  FileBytes file_;
  std::vector<Part> chunks_;
  ChannelNumbers channels_;
  std::size_t next_ = 0, bytes_ahead_ = 0;
  std::multimap<std::uint64_t, Bytes> ahead_;  // by their times
  Bytes content_;
};

// In the order in which they stand in the file.
class MessagesInPlace {
 public:
  MessagesInPlace(const std::string& path, const Part& part, ChannelNumbers channels, bool may_end_early)
      : file_(opened(path)), messages_(file_, part.begin, part.end, may_end_early), channels_(std::move(channels)) {}

  std::optional<Ros2RawMessage> next() {
    while (const auto message = messages_.next())
      if (channels_.contains(message->channel)) return Ros2RawMessage{message->time_ns, messages_.data()};
    return std::nullopt;
  }

 private:
  FileBytes file_;
  McapMessages messages_;
  ChannelNumbers channels_;
};

template <typename Messages>
Ros2FileMessages all_of(std::shared_ptr<Messages> messages) {
  return [messages = std::move(messages)] { return messages->next(); };
}

class McapFile : public Ros2File {
 public:
  explicit McapFile(const std::string& path) : path_(path) {
    FileBytes file = opened(path);
    const auto begin = file.bytes(0, std::min<std::uint64_t>(file.size(), magic.size()));
    if (!begin || !std::equal(begin->begin(), begin->end(), magic.begin(), magic.end()))
      throw InputError(path, "is no MCAP recording of version 0, expected one");
    auto summary = Summary::read(file);
    contents_ = summary ? std::move(*summary) : found_by_reading(file);
    if (contents_.ends_early_at)
      remark_ = fmt::format("{} was not finished by its recorder: of {} bytes the first {} are read",
                            std::filesystem::path(path).filename().string(), file.size(), *contents_.ends_early_at);
    for (const auto& [number, topic] : contents_.channels.topics) topics_.push_back(topic);
  }

  Ros2FileMessages messages(const std::string& name, const std::string& type) const override {
    ChannelNumbers wanted;
    for (const auto& [number, topic] : contents_.channels.topics)
      if (topic.name == name && topic.type == type) wanted.insert(number);
    if (contents_.chunks.empty())
      return all_of(std::make_shared<MessagesInPlace>(path_, contents_.all, std::move(wanted),
                                                      contents_.ends_early_at.has_value()));
    std::vector<Part> chunks;
    std::ranges::copy_if(contents_.chunks, std::back_inserter(chunks), [&](const Part& chunk) {
      const auto has = [&](std::uint16_t number) { return chunk.channels.contains(number); };
      return chunk.channels.empty() || std::ranges::any_of(wanted, has);
    });
    return all_of(std::make_shared<IndexedMessages>(path_, std::move(chunks), std::move(wanted)));
  }

 private:
  std::string path_;
  Contents contents_;
};

}  // namespace

std::unique_ptr<Ros2File> open_mcap_file(const std::string& path) {
  return std::make_unique<McapFile>(path);
}

}  // namespace lapservo::internal
