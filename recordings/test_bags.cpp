#include "recordings/test_bags.h"

#include <cmath>
#include <fstream>
#include <map>
#include <memory>
#include <ros/serialization.h>
#include <sqlite3.h>
#include <stdexcept>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "lapservo/testing/fast_cdr.h"
#include "transports/ros1/ros1_messages.h"

namespace lapservo::testing {
using namespace internal;
namespace {

using eprosima::fastcdr::Cdr;

template <typename Type>
std::vector<std::uint8_t> bytes_of(const Type& wire) {
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(wire));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, wire);
  return bytes;
}

// A message whose fields after the header are as they are given.
template <typename... Fields>
std::vector<std::uint8_t> written(double stamp_s, bool big_endian, const Fields&... fields) {
  eprosima::fastcdr::FastBuffer buffer;
  Cdr cdr(buffer, big_endian ? Cdr::BIG_ENDIANNESS : Cdr::LITTLE_ENDIANNESS, lapservo::testing::ros2_cdr);
  cdr.serialize_encapsulation();
  const double whole_s = std::floor(stamp_s);
  cdr << static_cast<std::int32_t>(whole_s) << static_cast<std::uint32_t>(std::lround(1e9 * (stamp_s - whole_s)))
      << std::string("frame");
  (cdr << ... << fields);
  const auto* const begin = reinterpret_cast<const std::uint8_t*>(buffer.getBuffer());
  return {begin, begin + lapservo::testing::bytes_of(cdr)};
}

}  // namespace

template <typename Message>
std::vector<std::uint8_t> ros1_bytes(const Message& message) {
  return bytes_of(ros1_message(message));
}
template std::vector<std::uint8_t> ros1_bytes(const JointMessage&);
template std::vector<std::uint8_t> ros1_bytes(const ImageMessage&);
template std::vector<std::uint8_t> ros1_bytes(const CompressedImageMessage&);
template std::vector<std::uint8_t> ros1_bytes(const PlaceMessage&);

std::vector<std::uint8_t> cdr_bytes(const JointMessage& message, bool big_endian) {
  const std::vector<double> velocities(message.positions.size(), 0.5), no_efforts;
  return written(message.stamp_s, big_endian, message.names, message.positions, velocities, no_efforts);
}
std::vector<std::uint8_t> cdr_bytes(const ImageMessage& message, bool big_endian) {
  return written(message.stamp_s, big_endian, message.height, message.width, message.encoding,
                 static_cast<std::uint8_t>(message.is_bigendian), message.step, message.data);
}
std::vector<std::uint8_t> cdr_bytes(const CompressedImageMessage& message, bool big_endian) {
  return written(message.stamp_s, big_endian, message.format, message.data);
}

void write_ros2_bag(const std::filesystem::path& path, const std::vector<BagEntry>& entries) {
  sqlite3* opened = nullptr;
  sqlite3_open(path.c_str(), &opened);
  const std::unique_ptr<sqlite3, decltype(&sqlite3_close)> database(opened, sqlite3_close);
  const auto run = [&](const std::string& command) {
    if (sqlite3_exec(database.get(), command.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
      throw std::runtime_error(sqlite3_errmsg(database.get()));
  };
  run("PRAGMA journal_mode = WAL; PRAGMA synchronous = NORMAL;"
      "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);"
      "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);"
      "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT "
      "NOT NULL, offered_qos_profiles TEXT NOT NULL);"
      "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB "
      "NOT NULL);"
      "CREATE INDEX timestamp_idx ON messages (timestamp ASC);"
      "INSERT INTO schema VALUES (3, 'humble'); BEGIN");
  std::map<std::string, int> numbers;
  for (const BagEntry& entry : entries) {
    const auto [number, is_new] = numbers.emplace(entry.topic, static_cast<int>(numbers.size()) + 1);
    std::string type = entry.type;
    type.insert(type.find('/'), "/msg");
    if (is_new)
      run(fmt::format("INSERT INTO topics VALUES ({}, '{}', '{}', 'cdr', '')", number->second, entry.topic, type));
    run(fmt::format("INSERT INTO messages(topic_id, timestamp, data) VALUES ({}, {}, x'{:02x}')", number->second,
                    std::llround(1e9 * entry.time_s), fmt::join(entry.bytes, "")));
  }
  run("COMMIT");
}

void write_ros2_metadata(const std::filesystem::path& folder, const std::vector<std::string>& files,
                         const std::string& storage, const std::string& compression) {
  std::ofstream file(folder / "metadata.yaml");
  file << "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: " << storage
       << "\n  duration:\n    nanoseconds: 1\n  compression_format: \"" << compression
       << "\"\n  compression_mode: \"\"\n  relative_file_paths:\n";
  for (const std::string& name : files) file << "    - " << name << "\n";
}

}  // namespace lapservo::testing
