#include "recordings/ros2_bag_writer.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <span>
#include <system_error>
#include <utility>
#include <zlib.h>

#include <yaml-cpp/yaml.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/core/new_folder.h"
#include "recordings/bag.h"
#include "recordings/file_bytes.h"
#include "recordings/mcap_format.h"
#include "transports/ros2/cdr_encoder.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

// The content of a record, field after field.
class McapRecord {
 public:
  explicit McapRecord(mcap::Op op) : op_(op) {}

  template <typename T>
  McapRecord& add(T value) {
    return append(&value, sizeof value);
  }
  McapRecord& block(const Bytes& bytes) {
    add(static_cast<std::uint32_t>(bytes.size()));
    return append(bytes.data(), bytes.size());
  }
  McapRecord& text(const std::string& text) { return block({text.begin(), text.end()}); }
  const Bytes& content() const { return content_; }
  /// Its opcode, length and content, of which so many bytes more follow.
  Bytes head(std::size_t follow) const {
    McapRecord record(op_);
    record.add(op_).add(std::uint64_t{content_.size() + follow}).append(content_.data(), content_.size());
    return std::move(record.content_);
  }

 private:
  McapRecord& append(const void* bytes, std::size_t count) {
    const std::size_t at = content_.size();
    content_.resize(at + count);
    if (count > 0) std::memcpy(&content_[at], bytes, count);
    return *this;
  }

  mcap::Op op_;
  Bytes content_;
};

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

struct Ros2BagWriter::File {
  struct Topic {
    std::uint16_t number = 0;  // of its channel and schema
    std::string type;
    std::uint64_t messages = 0;
  };

  explicit File(const fs::path& path)
      : folder(expect_empty(path)),
        name(fs::absolute(path).lexically_normal().filename().string() + "_0.mcap"),
        file(folder.path() / name, std::ios::binary) {
    file.write(reinterpret_cast<const char*>(mcap::magic.data()), mcap::magic.size());
    write(McapRecord(mcap::Op::header).text("ros2").text("lapservo"));
    flush();
  }

  // A bag in which nothing came to stand is none.
  ~File() {
    file.close();
    std::error_code error;
    if (topics.empty()) fs::remove(folder.path() / name, error);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  void write(const McapRecord& record, std::span<const std::uint8_t> rest = {}) {
    const Bytes head = record.head(rest.size());
    for (const std::span<const std::uint8_t> bytes : {std::span<const std::uint8_t>(head), rest})
      file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  void flush() {
    if (!file.flush())
      throw InputError((folder.path() / name).string(), std::string("can't be written (") + std::strerror(errno) + ")");
  }

  static McapRecord schema_of(const Topic& topic) {
    return McapRecord(mcap::Op::schema).add(topic.number).text(topic.type).text("").text("");
  }
  static McapRecord channel_of(const std::string& topic_name, const Topic& topic) {
    return McapRecord(mcap::Op::channel).add(topic.number).add(topic.number).text(topic_name).text("cdr").text("");
  }
  Topic& topic(const std::string& topic_name, const char* type) {
    const auto [found, is_new] = topics.try_emplace(topic_name);
    if (!is_new) return found->second;
    found->second = {static_cast<std::uint16_t>(topics.size()), type_in_ros2(type), 0};
    write(schema_of(found->second));
    write(channel_of(topic_name, found->second));
    return found->second;
  }

  void add(const std::string& topic_name, const char* type, double time_s, std::span<const std::uint8_t> bytes) {
    Topic& to = topic(topic_name, type);
    const auto time_ns = static_cast<std::uint64_t>(std::llround(1e9 * time_s));
    const auto sequence = static_cast<std::uint32_t>(++to.messages);
    write(McapRecord(mcap::Op::message).add(to.number).add(sequence).add(time_ns).add(time_ns), bytes);
    flush();
    first_ns = std::min(first_ns, time_ns), last_ns = std::max(last_ns, time_ns);
  }

  // In front of the footer: all topics, and how many messages they have.
  void end() {
    write(McapRecord(mcap::Op::data_end).add(std::uint32_t{0}));
    const auto begin = static_cast<std::uint64_t>(file.tellp());
    Bytes summary, counts;
    std::uint64_t messages = 0;
    const auto append = [](Bytes& to, const Bytes& bytes) { to.insert(to.end(), bytes.begin(), bytes.end()); };
    for (const auto& [topic_name, t] : topics) append(summary, schema_of(t).head(0));
    for (const auto& [topic_name, t] : topics) append(summary, channel_of(topic_name, t).head(0));
    McapRecord count(mcap::Op::none);
    for (const auto& [topic_name, t] : topics) count.add(t.number).add(t.messages), messages += t.messages;
    const auto number = static_cast<std::uint16_t>(topics.size());
    McapRecord statistics(mcap::Op::statistics);
    statistics.add(messages).add(number).add(std::uint32_t{number});
    for (int i = 0; i < 3; ++i) statistics.add(std::uint32_t{0});  // attachments, metadata, chunks
    statistics.add(messages > 0 ? first_ns : 0).add(last_ns).block(count.content());
    append(summary, statistics.head(0));
    append(summary, McapRecord(mcap::Op::footer).add(begin).add(std::uint64_t{0}).head(sizeof(std::uint32_t)));
    const auto crc = static_cast<std::uint32_t>(crc32_z(0, summary.data(), summary.size()));
    file.write(reinterpret_cast<const char*>(summary.data()), static_cast<std::streamsize>(summary.size()));
    file.write(reinterpret_cast<const char*>(&crc), sizeof crc);
    file.write(reinterpret_cast<const char*>(mcap::magic.data()), mcap::magic.size());
    flush();
  }

  std::string metadata() const {
    std::uint64_t messages = 0;
    for (const auto& [topic_name, t] : topics) messages += t.messages;
    const std::uint64_t begin_ns = messages > 0 ? first_ns : 0, duration_ns = messages > 0 ? last_ns - first_ns : 0;
    const auto times = [&](YAML::Emitter& yaml) {
      yaml << YAML::Key << "duration" << YAML::Value << YAML::BeginMap << YAML::Key << "nanoseconds" << YAML::Value
           << duration_ns << YAML::EndMap << YAML::Key << "starting_time" << YAML::Value << YAML::BeginMap << YAML::Key
           << "nanoseconds_since_epoch" << YAML::Value << begin_ns << YAML::EndMap << YAML::Key << "message_count"
           << YAML::Value << messages;
    };
    YAML::Emitter yaml;
    yaml << YAML::BeginMap << YAML::Key << "rosbag2_bagfile_information" << YAML::Value << YAML::BeginMap << YAML::Key
         << "version" << YAML::Value << 5 << YAML::Key << "storage_identifier" << YAML::Value << "mcap";
    times(yaml);
    yaml << YAML::Key << "topics_with_message_count" << YAML::Value << YAML::BeginSeq;
    for (const auto& [topic_name, t] : topics)
      yaml << YAML::BeginMap << YAML::Key << "topic_metadata" << YAML::Value << YAML::BeginMap << YAML::Key << "name"
           << YAML::Value << topic_name << YAML::Key << "type" << YAML::Value << t.type << YAML::Key
           << "serialization_format" << YAML::Value << "cdr" << YAML::Key << "offered_qos_profiles" << YAML::Value
           << YAML::DoubleQuoted << "" << YAML::EndMap << YAML::Key << "message_count" << YAML::Value << t.messages
           << YAML::EndMap;
    yaml << YAML::EndSeq << YAML::Key << "compression_format" << YAML::Value << YAML::DoubleQuoted << "" << YAML::Key
         << "compression_mode" << YAML::Value << YAML::DoubleQuoted << "" << YAML::Key << "relative_file_paths"
         << YAML::Value << YAML::BeginSeq << name << YAML::EndSeq << YAML::Key << "files" << YAML::Value
         << YAML::BeginSeq << YAML::BeginMap << YAML::Key << "path" << YAML::Value << name;
    times(yaml);
    yaml << YAML::EndMap << YAML::EndSeq << YAML::EndMap << YAML::EndMap;
    return std::string(yaml.c_str()) + "\n";
  }

  NewFolder folder;
  std::string name;
  std::ofstream file;
  std::map<std::string, Topic> topics;
  std::uint64_t first_ns = std::numeric_limits<std::uint64_t>::max(), last_ns = 0;
};

Ros2BagWriter::Ros2BagWriter(const fs::path& folder) : file_(std::make_unique<File>(folder)) {}

Ros2BagWriter::~Ros2BagWriter() = default;

void Ros2BagWriter::write(const std::string& topic, double time_s, const JointMessage& message) {
  file_->add(topic, joint_type, time_s, encode_cdr(message));
}

void Ros2BagWriter::write(const std::string& topic, double time_s, const ImageMessage& message) {
  file_->add(topic, image_type, time_s, encode_cdr(message));
}

void Ros2BagWriter::write(const std::string& topic, double time_s, const CompressedImageMessage& message) {
  file_->add(topic, compressed_image_type, time_s, encode_cdr(message));
}

void Ros2BagWriter::finish() {
  file_->end();
  if (!file_->topics.empty()) write_file(file_->folder.path() / "metadata.yaml", file_->metadata());
}

}  // namespace lapservo::internal
