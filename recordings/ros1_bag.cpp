#include <algorithm>
#include <cstring>
#include <deque>
#include <filesystem>
#include <limits>
#include <map>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "lapservo/core/error.h"
#include "recordings/bag_endings.h"
#include "recordings/chunk_compression.h"
#include "recordings/file_bytes.h"
#include "recordings/open_bag.h"
#include "transports/ros1/ros1_decoder.h"

namespace lapservo::internal {
namespace {

namespace fs = std::filesystem;
using Fields = std::map<std::string, std::string, std::less<>>;

enum Op : std::uint8_t { message_op = 2, bag_op = 3, chunk_op = 5, chunk_info_op = 6, connection_op = 7 };

constexpr std::string_view magic = "#ROSBAG V2.0\n";

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw InputError(path, what + ": copy it again, or try `rosbag reindex`");
}
[[noreturn]] void refuse_damage(const std::string& path, std::uint64_t at) {
  refuse(path, fmt::format("is cut short or damaged at byte {}, expected a whole ROS 1 bag", at));
}

std::optional<Fields> fields_of(ByteView header) {
  Fields fields;
  while (!header.empty()) {
    const auto field = block_taken(header);
    if (!field) return std::nullopt;
    const std::string text(field->begin(), field->end());
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos) return std::nullopt;
    fields[text.substr(0, equals)] = text.substr(equals + 1);
  }
  return fields;
}

template <typename T>
std::optional<T> number_in(const Fields& fields, std::string_view name) {
  const auto field = fields.find(name);
  if (field == fields.end() || field->second.size() != sizeof(T)) return std::nullopt;
  T value;
  std::memcpy(&value, field->second.data(), sizeof value);
  return value;
}
std::string text_in(const Fields& fields, std::string_view name) {
  const auto field = fields.find(name);
  return field == fields.end() ? std::string() : field->second;
}
std::optional<double> time_in(const Fields& fields, std::string_view name) {
  const auto time = number_in<std::array<std::uint32_t, 2>>(fields, name);
  return time ? std::optional((*time)[0] + 1e-9 * (*time)[1]) : std::nullopt;
}
bool is(const Fields& fields, Op op) {
  return number_in<std::uint8_t>(fields, "op") == op;
}

struct Record {
  Fields fields;
  Bytes data;
};

// Records by their place in a file.
class RecordFile {
 public:
  explicit RecordFile(const std::string& path) : file_(path, "a ROS 1 bag") {}

  std::uint64_t size() const { return file_.size(); }
  Bytes bytes(std::uint64_t at, std::uint64_t count) {
    auto bytes = file_.bytes(at, count);
    if (!bytes) refuse_damage(file_.path(), at);
    return std::move(*bytes);
  }
  /// Moves `at` behind it.
  Record record(std::uint64_t& at) {
    const std::uint64_t begin = at;
    auto fields = fields_of(block(at));
    if (!fields) refuse_damage(file_.path(), begin);
    return {std::move(*fields), block(at)};
  }

 private:
  Bytes block(std::uint64_t& at) {
    const Bytes length = bytes(at, 4);
    ByteView from(length);
    const std::uint32_t size = *taken<std::uint32_t>(from);
    auto content = bytes(at + 4, size);
    at += 4 + std::uint64_t{size};
    return content;
  }

  FileBytes file_;
};

struct Chunk {
  std::uint64_t at = 0;
  std::map<std::uint32_t, std::uint32_t> messages;  // by connection
  double begin_s = 0, end_s = 0;
};

class Ros1Messages : public BagMessages {
 public:
  Ros1Messages(const std::string& path, std::string type, std::vector<std::uint32_t> connections,
               std::vector<std::uint64_t> chunks)
      : path_(path),
        type_(std::move(type)),
        connections_(std::move(connections)),
        chunks_(std::move(chunks)),
        file_(path) {}

  std::optional<BagMessage> next() override {
    while (true) {
      if (rest_.empty() && !next_chunk()) return std::nullopt;
      const auto header = block_taken(rest_), data = block_taken(rest_);
      const auto fields = header && data ? fields_of(*header) : std::nullopt;
      if (!fields) refuse_damage(path_, chunks_[next_ - 1]);
      const auto connection = number_in<std::uint32_t>(*fields, "conn");
      if (!is(*fields, message_op) || !connection ||
          !std::binary_search(connections_.begin(), connections_.end(), *connection))
        continue;
      recorded_s_ = time_in(*fields, "time").value_or(0);
      return decode_bag_message(
          type_, []<typename Message>(const ByteView& bytes) { return decode_ros1<Message>(bytes); }, *data);
    }
  }
  double recorded_s() const override { return recorded_s_; }

 private:
  bool next_chunk() {
    if (next_ == chunks_.size()) return false;
    std::uint64_t at = chunks_[next_++];
    const std::uint64_t begin = at;
    Record record = file_.record(at);
    const auto size = number_in<std::uint32_t>(record.fields, "size");
    if (!is(record.fields, chunk_op) || !size) refuse_damage(path_, begin);
    const std::string compression = text_in(record.fields, "compression");
    auto content = compression == "none"      ? std::optional(std::move(record.data))
                   : *size <= most_of_a_chunk ? inflated(compression, record.data, *size)
                                              : std::nullopt;
    if (!content || content->size() != *size) refuse_damage(path_, begin);
    content_ = std::move(*content);
    rest_ = content_;
    return true;
  }

  std::string path_, type_;
  std::vector<std::uint32_t> connections_;
  std::vector<std::uint64_t> chunks_;
  RecordFile file_;
  std::size_t next_ = 0;
  Bytes content_;
  ByteView rest_;
  double recorded_s_ = 0;
};

class Ros1Bag : public Bag {
 public:
  explicit Ros1Bag(const std::string& path) : Bag(path) {
    RecordFile file(path);
    const auto begin = file.bytes(0, std::min<std::uint64_t>(file.size(), magic.size()));
    if (!std::equal(begin.begin(), begin.end(), magic.begin(), magic.end()))
      throw InputError(path, "is no ROS 1 bag of format 2.0: older ones can be converted by `rosbag fix`");
    read_index(file, index_position(file));
    list_topics();
  }

  double begin_s() const {
    double begin_s = std::numeric_limits<double>::infinity();
    for (const Chunk& chunk : chunks_) begin_s = std::min(begin_s, chunk.begin_s);
    return begin_s;
  }

  std::unique_ptr<BagMessages> messages(const BagTopic& topic) const override {
    const auto wanted = connections_.at({topic.name, topic.type});
    std::vector<std::uint64_t> chunks;
    for (const Chunk& chunk : chunks_)
      if (std::any_of(wanted.begin(), wanted.end(),
                      [&](auto connection) { return chunk.messages.contains(connection); }))
        chunks.push_back(chunk.at);
    return std::make_unique<Ros1Messages>(path_, topic.type, wanted, std::move(chunks));
  }

 private:
  std::uint64_t index_position(RecordFile& file) {
    std::uint64_t at = magic.size();
    const Fields header = file.record(at).fields;
    const auto index = number_in<std::uint64_t>(header, "index_pos");
    if (!is(header, bag_op) || !index) refuse_damage(path_, magic.size());
    if (!text_in(header, "encryptor").empty())
      throw InputError(path_, "is encrypted, expected a bag without: decrypt it with `rosbag decrypt`");
    if (*index == 0) refuse(path_, "was not closed by its recorder and has no index, expected a whole ROS 1 bag");
    if (*index >= file.size())
      refuse(path_, fmt::format("is cut short: its index begins at byte {} of {}", *index, file.size()));
    return *index;
  }
  void read_index(RecordFile& file, std::uint64_t at) {
    while (at < file.size()) {
      const std::uint64_t begin = at;
      const Record record = file.record(at);
      if (is(record.fields, connection_op)) {
        add_connection(record, begin);
      } else if (is(record.fields, chunk_info_op)) {
        add_chunk(record, begin);
      }
    }
    std::sort(chunks_.begin(), chunks_.end(), [](const Chunk& a, const Chunk& b) { return a.at < b.at; });
  }
  void add_connection(const Record& record, std::uint64_t at) {
    const auto number = number_in<std::uint32_t>(record.fields, "conn");
    const auto header = fields_of(record.data);
    if (!number || !header) refuse_damage(path_, at);
    auto& numbers = connections_[{text_in(record.fields, "topic"), text_in(*header, "type")}];
    numbers.insert(std::upper_bound(numbers.begin(), numbers.end(), *number), *number);
  }
  void add_chunk(const Record& record, std::uint64_t at) {
    const auto place = number_in<std::uint64_t>(record.fields, "chunk_pos");
    const auto begin_s = time_in(record.fields, "start_time"), end_s = time_in(record.fields, "end_time");
    if (!place || !begin_s || !end_s || record.data.size() % 8 != 0) refuse_damage(path_, at);
    Chunk chunk{*place, {}, *begin_s, *end_s};
    for (ByteView counts(record.data); !counts.empty();) {
      const auto connection = *taken<std::uint32_t>(counts);
      chunk.messages[connection] = *taken<std::uint32_t>(counts);
    }
    chunks_.push_back(std::move(chunk));
  }
  void list_topics() {
    for (const auto& [names, numbers] : connections_) {
      BagTopic topic{names.first, names.second, 0, 0};
      std::optional<double> begin_s;
      for (const Chunk& chunk : chunks_)
        for (const std::uint32_t number : numbers)
          if (const auto counted = chunk.messages.find(number); counted != chunk.messages.end()) {
            topic.messages += counted->second;
            if (!begin_s) begin_s = chunk.begin_s;
            topic.duration_s = chunk.end_s - *begin_s;
          }
      topics_.push_back(std::move(topic));
    }
  }

  std::map<std::pair<std::string, std::string>, std::vector<std::uint32_t>> connections_;  // by topic and type
  std::vector<Chunk> chunks_;
};

// One part's after the other.
class ChainedMessages : public BagMessages {
 public:
  explicit ChainedMessages(std::deque<std::unique_ptr<BagMessages>> parts) : parts_(std::move(parts)) {}

  std::optional<BagMessage> next() override {
    for (; !parts_.empty(); parts_.pop_front()) {
      auto message = parts_.front()->next();
      recorded_s_ = parts_.front()->recorded_s();
      if (message) return message;
    }
    return std::nullopt;
  }
  double recorded_s() const override { return recorded_s_; }

 private:
  std::deque<std::unique_ptr<BagMessages>> parts_;
  double recorded_s_ = 0;
};

// A folder of the files of `rosbag record --split`.
class SplitRos1Bag : public Bag {
 public:
  explicit SplitRos1Bag(const std::string& folder) : Bag(folder) {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
      if (ends_like_ros1_bag(entry->path().string()))
        parts_.push_back(std::make_unique<Ros1Bag>(entry->path().string()));
    std::ranges::sort(parts_, {}, [](const auto& part) { return part->begin_s(); });
    for (const auto& part : parts_)
      for (const BagTopic& topic : part->topics()) add(topic);
    remark_ = fmt::format("its {} bags are read as one, in the order of their times", parts_.size());
  }

  std::unique_ptr<BagMessages> messages(const BagTopic& topic) const override {
    std::deque<std::unique_ptr<BagMessages>> messages;
    for (const auto& part : parts_)
      for (const BagTopic& of_part : part->topics())
        if (is_same(of_part, topic)) messages.push_back(part->messages(of_part));
    return std::make_unique<ChainedMessages>(std::move(messages));
  }

 private:
  static bool is_same(const BagTopic& a, const BagTopic& b) { return a.name == b.name && a.type == b.type; }
  void add(const BagTopic& topic) {
    const auto known = std::ranges::find_if(topics_, [&](const BagTopic& one) { return is_same(one, topic); });
    if (known == topics_.end()) return topics_.push_back(topic);
    known->messages += topic.messages, known->duration_s += topic.duration_s;
  }

  std::vector<std::unique_ptr<Ros1Bag>> parts_;
};

}  // namespace

std::unique_ptr<Bag> open_ros1_bag(const std::string& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return std::make_unique<SplitRos1Bag>(path);
  return std::make_unique<Ros1Bag>(path);
}

}  // namespace lapservo::internal
