#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <string>

#include "lapservo/core/new_folder.h"
#include "recordings/bag.h"
#include "recordings/file_bytes.h"
#include "transports/ros2/cdr.h"

namespace lapservo::internal {

/// Writes a ROS 2 bag as rosbag2 does: a folder of metadata.yaml and an .mcap, without chunks (rosbag2's preset
/// `fastwrite`). Written messages survive the program.
class Ros2BagWriter {
 public:
  /// Throws InputError when `folder` holds something already or can't be written.
  explicit Ros2BagWriter(const std::filesystem::path& folder);
  /// A bag in which nothing came to stand is none.
  ~Ros2BagWriter();
  Ros2BagWriter(const Ros2BagWriter&) = delete;
  Ros2BagWriter& operator=(const Ros2BagWriter&) = delete;

  /// `time_s`: of its recording, since 1970. Messages of a topic are of one type. One thread at a time. Throws
  /// InputError where it can't be written, for example because the disk is full.
  template <typename Message>
  void write(const std::string& topic, double time_s, const Message& message) {
    add(topic, bag_type<Message>, time_s, encode_cdr(message));
  }

  /// Writes metadata.yaml, which completes the bag. Without messages no bag is made.
  void finish();

 private:
  struct Topic {
    std::uint16_t number = 0;  ///< of its channel and schema
    std::string type;
    std::uint64_t messages = 0;
  };
  class Record;
  static Record schema_of(const Topic& topic);
  static Record channel_of(const std::string& name, const Topic& topic);

  void add(const std::string& name, const char* type, double time_s, const Bytes& bytes);
  Topic& topic(const std::string& name, const char* type);
  void put(ByteView bytes);
  void put(const Record& record, ByteView rest = {});
  void flush();
  void end();
  std::string metadata() const;
  std::filesystem::path path() const { return folder_.path() / name_; }

  NewFolder folder_;
  std::string name_;  ///< of the file in it
  std::ofstream file_;
  std::map<std::string, Topic> topics_;
  std::uint64_t first_ns_ = std::numeric_limits<std::uint64_t>::max(), last_ns_ = 0;
};

}  // namespace lapservo::internal
