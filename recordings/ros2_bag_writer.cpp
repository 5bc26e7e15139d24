#include "recordings/ros2_bag_writer.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <sqlite3.h>
#include <system_error>

#include <yaml-cpp/yaml.h>

#include "lapservo/core/atomic_file.h"
#include "lapservo/core/error.h"
#include "lapservo/core/new_folder.h"
#include "recordings/bag.h"
#include "transports/ros2/cdr_encoder.h"

namespace lapservo::internal {
namespace {
namespace fs = std::filesystem;

constexpr double commit_every_s = 0.5;

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
    int number = 0;
    std::string type;
    std::int64_t messages = 0;
  };

  explicit File(const fs::path& path)
      : folder(expect_empty(path)), name(fs::absolute(path).lexically_normal().filename().string() + "_0.db3") {
    sqlite3* opened = nullptr;
    const int result = sqlite3_open((folder.path() / name).c_str(), &opened);
    database.reset(opened, sqlite3_close_v2);
    if (result != SQLITE_OK) fail();
    run("PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL;"
        "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
        "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);"
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
        "NOT NULL, offered_qos_profiles TEXT NOT NULL);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, "
        "data BLOB NOT NULL);"
        "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
        "INSERT INTO schema VALUES (3, 'humble');");
    add_topic = prepared("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')");
    add_message = prepared("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)");
    run("BEGIN");
  }

  // A bag in which nothing came to stand is none.
  ~File() {
    add_topic.reset(), add_message.reset(), database.reset();
    std::error_code error;
    if (topics.empty())
      for (const char* end : {"", "-wal", "-shm"}) fs::remove(folder.path() / (name + end), error);
  }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  [[noreturn]] void fail() const {
    throw InputError((folder.path() / name).string(),
                     std::string("can't be written (") + sqlite3_errmsg(database.get()) + ")");
  }
  void run(const char* command) {
    if (sqlite3_exec(database.get(), command, nullptr, nullptr, nullptr) != SQLITE_OK) fail();
  }
  std::shared_ptr<sqlite3_stmt> prepared(const char* command) {
    sqlite3_stmt* statement = nullptr;
    if (sqlite3_prepare_v2(database.get(), command, -1, &statement, nullptr) != SQLITE_OK) fail();
    return {statement, sqlite3_finalize};
  }
  void step(sqlite3_stmt* statement) {
    if (sqlite3_step(statement) != SQLITE_DONE) fail();
    sqlite3_reset(statement);
  }

  Topic& topic(const std::string& topic_name, const char* type) {
    const auto [found, is_new] = topics.try_emplace(topic_name);
    if (!is_new) return found->second;
    found->second = {static_cast<int>(topics.size()), type_in_ros2(type), 0};
    sqlite3_bind_int(add_topic.get(), 1, found->second.number);
    sqlite3_bind_text(add_topic.get(), 2, topic_name.c_str(), -1, SQLITE_TRANSIENT);
    sqlite3_bind_text(add_topic.get(), 3, found->second.type.c_str(), -1, SQLITE_TRANSIENT);
    step(add_topic.get());
    return found->second;
  }

  void add(const std::string& topic_name, const char* type, double time_s, std::span<const std::uint8_t> bytes) {
    Topic& to = topic(topic_name, type);
    const auto time_ns = static_cast<std::int64_t>(std::llround(1e9 * time_s));
    sqlite3_bind_int(add_message.get(), 1, to.number);
    sqlite3_bind_int64(add_message.get(), 2, time_ns);
    sqlite3_bind_blob64(add_message.get(), 3, bytes.data(), bytes.size(), SQLITE_STATIC);
    step(add_message.get());
    ++to.messages, first_ns = std::min(first_ns, time_ns), last_ns = std::max(last_ns, time_ns);
    if (time_s < committed_s + commit_every_s && time_s >= committed_s) return;
    committed_s = time_s;
    run("COMMIT; BEGIN");
  }

  std::string metadata() const {
    std::int64_t messages = 0;
    for (const auto& [topic_name, t] : topics) messages += t.messages;
    const std::int64_t begin_ns = messages > 0 ? first_ns : 0, duration_ns = messages > 0 ? last_ns - first_ns : 0;
    const auto times = [&](YAML::Emitter& yaml) {
      yaml << YAML::Key << "duration" << YAML::Value << YAML::BeginMap << YAML::Key << "nanoseconds" << YAML::Value
           << duration_ns << YAML::EndMap << YAML::Key << "starting_time" << YAML::Value << YAML::BeginMap << YAML::Key
           << "nanoseconds_since_epoch" << YAML::Value << begin_ns << YAML::EndMap << YAML::Key << "message_count"
           << YAML::Value << messages;
    };
    YAML::Emitter yaml;
    yaml << YAML::BeginMap << YAML::Key << "rosbag2_bagfile_information" << YAML::Value << YAML::BeginMap << YAML::Key
         << "version" << YAML::Value << 5 << YAML::Key << "storage_identifier" << YAML::Value << "sqlite3";
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
  std::shared_ptr<sqlite3> database;
  std::shared_ptr<sqlite3_stmt> add_topic, add_message;  // before the database is closed
  std::map<std::string, Topic> topics;
  std::int64_t first_ns = std::numeric_limits<std::int64_t>::max(), last_ns = std::numeric_limits<std::int64_t>::min();
  double committed_s = 0;
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
  file_->run("COMMIT; PRAGMA wal_checkpoint(TRUNCATE)");
  file_->add_topic.reset(), file_->add_message.reset();
  file_->run("PRAGMA journal_mode = DELETE");
  if (!file_->topics.empty()) write_file(file_->folder.path() / "metadata.yaml", file_->metadata());
}

}  // namespace lapservo::internal
