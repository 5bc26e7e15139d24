#include "recordings/ros2_bag_writer.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <system_error>
#include <utility>
#include <zlib.h>

#include <yaml-cpp/yaml.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "recordings/mcap_format.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

fs::path expect_empty(const fs::path& folder) {
  std::error_code error;
  if (fs::exists(folder, error) && !fs::is_empty(folder, error))
    throw InputError(folder.string(), "exists, expected the name of a new folder");
  return folder;
}

// The type's name in ROS 2: sensor_msgs/msg/JointState of sensor_msgs/JointState.
std::string type_in_ros2(std::string type) {
  return type.insert(type.find('/'), "/msg");
}

}  // namespace

// The content of a record, field after field.
class Ros2BagWriter::Record {
 public:
  explicit Record(mcap::Op op) : op_(op) {}

  template <typename T>
  Record& add(T value) {
    return append(&value, sizeof value);
  }
  Record& block(const Bytes& bytes) {
    add(static_cast<std::uint32_t>(bytes.size()));
    return append(bytes.data(), bytes.size());
  }
  Record& text(const std::string& text) { return block({text.begin(), text.end()}); }
  const Bytes& content() const { return content_; }
  /// Its opcode, length and content, of which so many bytes more follow.
  Bytes head(std::size_t follow) const {
    Record record(op_);
    record.add(op_).add(std::uint64_t{content_.size() + follow}).append(content_.data(), content_.size());
    return std::move(record.content_);
  }

 private:
  Record& append(const void* bytes, std::size_t count) {
    const std::size_t at = content_.size();
    content_.resize(at + count);
    if (count > 0) std::memcpy(&content_[at], bytes, count);
    return *this;
  }

  mcap::Op op_;
  Bytes content_;
};

Ros2BagWriter::Ros2BagWriter(const fs::path& folder)
    : folder_(expect_empty(folder)),
      name_(fs::absolute(folder).lexically_normal().filename().string() + "_0.mcap"),
      file_(path(), std::ios::binary) {
  put(mcap::magic);
  put(Record(mcap::Op::header).text("ros2").text("lapservo"));
  flush();
}

Ros2BagWriter::~Ros2BagWriter() {
  file_.close();
  std::error_code error;
  if (topics_.empty()) fs::remove(path(), error);
}

void Ros2BagWriter::put(ByteView bytes) {
  file_.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

void Ros2BagWriter::put(const Record& record, ByteView rest) {
  put(record.head(rest.size()));
  put(rest);
}

void Ros2BagWriter::flush() {
  if (!file_.flush()) throw InputError(path().string(), std::string("can't be written (") + std::strerror(errno) + ")");
}

Ros2BagWriter::Record Ros2BagWriter::schema_of(const Topic& topic) {
  return Record(mcap::Op::schema).add(topic.number).text(topic.type).text("").text("");
}

Ros2BagWriter::Record Ros2BagWriter::channel_of(const std::string& name, const Topic& topic) {
  return Record(mcap::Op::channel).add(topic.number).add(topic.number).text(name).text("cdr").text("");
}

Ros2BagWriter::Topic& Ros2BagWriter::topic(const std::string& name, const char* type) {
  const auto [found, is_new] = topics_.try_emplace(name);
  if (!is_new) return found->second;
  found->second = {static_cast<std::uint16_t>(topics_.size()), type_in_ros2(type), 0};
  put(schema_of(found->second));
  put(channel_of(name, found->second));
  return found->second;
}

void Ros2BagWriter::add(const std::string& name, const char* type, double time_s, const Bytes& bytes) {
  Topic& to = topic(name, type);
  const auto time_ns = static_cast<std::uint64_t>(std::llround(1e9 * time_s));
  const auto sequence = static_cast<std::uint32_t>(++to.messages);
  put(Record(mcap::Op::message).add(to.number).add(sequence).add(time_ns).add(time_ns), bytes);
  flush();
  first_ns_ = std::min(first_ns_, time_ns), last_ns_ = std::max(last_ns_, time_ns);
}

// In front of the footer: all topics, and how many messages they have.
void Ros2BagWriter::end() {
  put(Record(mcap::Op::data_end).add(std::uint32_t{0}));
  const auto begin = static_cast<std::uint64_t>(file_.tellp());
  Bytes summary;
  std::uint64_t messages = 0;
  const auto append = [](Bytes& to, const Bytes& bytes) { to.insert(to.end(), bytes.begin(), bytes.end()); };
  for (const auto& [topic_name, t] : topics_) append(summary, schema_of(t).head(0));
  for (const auto& [topic_name, t] : topics_) append(summary, channel_of(topic_name, t).head(0));
  Record count(mcap::Op::none);
  for (const auto& [topic_name, t] : topics_) count.add(t.number).add(t.messages), messages += t.messages;
  const auto number = static_cast<std::uint16_t>(topics_.size());
  Record statistics(mcap::Op::statistics);
  statistics.add(messages).add(number).add(std::uint32_t{number});
  for (int i = 0; i < 3; ++i) statistics.add(std::uint32_t{0});  // attachments, metadata, chunks
  statistics.add(messages > 0 ? first_ns_ : 0).add(last_ns_).block(count.content());
  append(summary, statistics.head(0));
  append(summary, Record(mcap::Op::footer).add(begin).add(std::uint64_t{0}).head(sizeof(std::uint32_t)));
  const auto crc = static_cast<std::uint32_t>(crc32_z(0, summary.data(), summary.size()));
  put(summary);
  put({reinterpret_cast<const std::uint8_t*>(&crc), sizeof crc});
  put(mcap::magic);
  flush();
}

std::string Ros2BagWriter::metadata() const {
  std::uint64_t messages = 0;
  for (const auto& [topic_name, t] : topics_) messages += t.messages;
  const std::uint64_t begin_ns = messages > 0 ? first_ns_ : 0, duration_ns = messages > 0 ? last_ns_ - first_ns_ : 0;
  const auto put_times = [&](YAML::Node to) {
    to["duration"]["nanoseconds"] = duration_ns;
    to["starting_time"]["nanoseconds_since_epoch"] = begin_ns;
    to["message_count"] = messages;
  };
  YAML::Node metadata, information = metadata["rosbag2_bagfile_information"];
  information["version"] = 5;
  information["storage_identifier"] = "mcap";
  put_times(information);
  for (const auto& [topic_name, t] : topics_) {
    YAML::Node topic, of_topic = topic["topic_metadata"];
    of_topic["name"] = topic_name;
    of_topic["type"] = t.type;
    of_topic["serialization_format"] = "cdr";
    of_topic["offered_qos_profiles"] = "";
    topic["message_count"] = t.messages;
    information["topics_with_message_count"].push_back(topic);
  }
  information["compression_format"] = "";
  information["compression_mode"] = "";
  information["relative_file_paths"].push_back(name_);
  YAML::Node file;
  file["path"] = name_;
  put_times(file);
  information["files"].push_back(file);
  return YAML::Dump(metadata) + "\n";
}

void Ros2BagWriter::finish() {
  end();
  if (!topics_.empty()) write_file(folder_.path() / "metadata.yaml", metadata());
}

}  // namespace lapservo::internal
